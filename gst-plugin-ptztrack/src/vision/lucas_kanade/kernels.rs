// SPDX-License-Identifier: MPL-2.0

//! What is done with every pixel of a window.
//!
//! A row of a template holds what is known, its gradient to the right and its gradient downwards, one after the other, each in
//! [`SCALE`]ths of a grey level and filled up with zeros to whole [`LANES`].

use std::ops::Range;

use multiversion::multiversion;

use super::{LANES, MAX_ROW};

/// Parts of a grey level that a template tells apart.
const SCALE: f32 = 64.0;

/// Numbers in a row of a template.
pub(super) fn row_length(side: usize) -> usize {
    3 * side.next_multiple_of(LANES)
}

/// A row of numbers; as long as is needed.
type Row = [f32; MAX_ROW];
const EMPTY: Row = [0.0; MAX_ROW];
/// Numbers that are worked on at once.
type Lanes = [f32; LANES];

/// Takes a template of what lies `part` of a pixel right of and below the second pixel of the second row of `seen`, whose rows are
/// `stride` apart. What is not `inside` (columns and rows) has no gradient. Gives the upper triangle of the gradient matrix (3.11),
/// per pixel.
#[multiversion(targets("x86_64+avx2"))]
pub(super) fn take(
    seen: &[u8],
    stride: usize,
    part: (f32, f32),
    inside: (Range<usize>, Range<usize>),
    side: usize,
    rows: &mut [i16],
) -> [f32; 3] {
    // Of a length that is known, a row is worked on without a loop.
    let sums = match side.div_ceil(LANES) {
        1 => take_of::<1>(seen, stride, part, inside, side, rows),
        2 => take_of::<2>(seen, stride, part, inside, side, rows),
        3 => take_of::<3>(seen, stride, part, inside, side, rows),
        _ => take_of::<4>(seen, stride, part, inside, side, rows),
    };
    sums.map(|sums| per_pixel(sums.iter().sum(), side))
}

/// The same of a window that is so many `GROUPS` of lanes wide, summed in lanes.
#[inline(always)]
fn take_of<const GROUPS: usize>(
    seen: &[u8],
    stride: usize,
    part: (f32, f32),
    inside: (Range<usize>, Range<usize>),
    side: usize,
    rows: &mut [i16],
) -> [Lanes; 3] {
    let count = (side + 2).next_multiple_of(LANES);
    let mut above = EMPTY;
    across(seen, part.0, &mut above[..count]);
    let mut last = [EMPTY; 3];
    let mut sums = [[0.0; LANES]; 3];
    for y in 0..side + 2 {
        next_row(&mut above[..count], &seen[(y + 1) * stride..], part, &mut last[y % 3][..count]);
        let Some(row) = y.checked_sub(2) else { continue };
        let template = rows.as_chunks_mut::<LANES>().0[row * 3 * GROUPS..][..3 * GROUPS].as_flattened_mut();
        let (known, gradients) = template.split_at_mut(GROUPS * LANES);
        let (right, down) = gradients.split_at_mut(GROUPS * LANES);
        let columns = if inside.1.contains(&row) { inside.0.clone() } else { 0..0 };
        let around = [y + 1, y + 2, y].map(|y| &last[y % 3]);
        gradient::<GROUPS>(around, columns, (&mut *known, &mut *right, &mut *down), side);
        let [xx, xy, yy] = &mut sums;
        add_products(right, right, xx);
        add_products(right, down, xy);
        add_products(down, down, yy);
    }
    sums
}

/// The mismatch (3.11): gradients times differences of what is seen and what is known, per pixel. The window starts `part` of a pixel
/// right of and below the first of `seen`, whose rows are `stride` apart.
#[multiversion(targets("x86_64+avx2"))]
pub(super) fn mismatch(rows: &[i16], seen: &[u8], stride: usize, part: (f32, f32), side: usize) -> [f32; 2] {
    // Of a length that is known, a row stays in registers.
    let sums = match side.div_ceil(LANES) {
        1 => mismatch_of::<1>(rows, seen, stride, part),
        2 => mismatch_of::<2>(rows, seen, stride, part),
        3 => mismatch_of::<3>(rows, seen, stride, part),
        _ => mismatch_of::<4>(rows, seen, stride, part),
    };
    sums.map(|sums| per_pixel(sums.iter().sum(), side))
}

/// The same of a window that is so many `GROUPS` of lanes wide, summed in lanes.
#[inline(always)]
fn mismatch_of<const GROUPS: usize>(
    rows: &[i16],
    seen: &[u8],
    stride: usize,
    part: (f32, f32),
) -> [[f32; LANES]; 2] {
    let mut sums = [[0.0; LANES]; 2];
    let mut above = first_row::<GROUPS>(seen, part);
    for (y, row) in rows.as_chunks().0.chunks_exact(3 * GROUPS).enumerate() {
        let (known, gradients) = row.split_at(GROUPS);
        let off = differ(&mut above, &seen[(y + 1) * stride..], part, known);
        for (gradient, sums) in gradients.chunks_exact(GROUPS).zip(&mut sums) {
            add_products(off.as_flattened(), gradient.as_flattened(), sums);
        }
    }
    sums
}

/// Mean absolute difference of what is seen and what is known, grey levels; where it lies as for [`mismatch`].
#[multiversion(targets("x86_64+avx2"))]
pub(super) fn residual(rows: &[i16], seen: &[u8], stride: usize, part: (f32, f32), side: usize) -> f32 {
    let sum = match side.div_ceil(LANES) {
        1 => residual_of::<1>(rows, seen, stride, part, side),
        2 => residual_of::<2>(rows, seen, stride, part, side),
        3 => residual_of::<3>(rows, seen, stride, part, side),
        _ => residual_of::<4>(rows, seen, stride, part, side),
    };
    SCALE * per_pixel(sum, side)
}

/// The sum of differences in a window that is so many `GROUPS` of lanes wide.
#[inline(always)]
fn residual_of<const GROUPS: usize>(
    rows: &[i16],
    seen: &[u8],
    stride: usize,
    part: (f32, f32),
    side: usize,
) -> f32 {
    let mut above = first_row::<GROUPS>(seen, part);
    let mut sum = 0.0;
    for (y, row) in rows.as_chunks().0.chunks_exact(3 * GROUPS).enumerate() {
        let off = differ(&mut above, &seen[(y + 1) * stride..], part, &row[..GROUPS]);
        sum += off.as_flattened()[..side].iter().map(|off| off.abs()).sum::<f32>();
    }
    sum
}

/// The sum of products of two numbers in [`SCALE`]ths, over the pixels of a window.
#[inline(always)]
fn per_pixel(sum: f32, side: usize) -> f32 {
    sum / (SCALE * SCALE * (side * side) as f32)
}

/// Pixels `part` of the way to the next one.
#[inline(always)]
fn across(seen: &[u8], part: f32, out: &mut [f32]) {
    for (index, out) in out.as_chunks_mut::<LANES>().0.iter_mut().enumerate() {
        *out = across_lanes(&seen[index * LANES..], part);
    }
}

#[inline(always)]
fn across_lanes(seen: &[u8], part: f32) -> [f32; LANES] {
    let mut out = [0.0; LANES];
    if let Some(seen) = seen.first_chunk::<{ LANES + 1 }>() {
        for lane in 0..LANES {
            let (here, next) = (f32::from(seen[lane]), f32::from(seen[lane + 1]));
            out[lane] = here + part * (next - here);
        }
    }
    out
}

/// The row of a window of so many `GROUPS` of lanes that [`differ`] starts from.
#[inline(always)]
fn first_row<const GROUPS: usize>(seen: &[u8], part: (f32, f32)) -> [Lanes; GROUPS] {
    let mut above = [[0.0; LANES]; GROUPS];
    across(seen, part.0, above.as_flattened_mut());
    above
}

/// How the row of a window between the one `above` and the one that is `seen`, which is the one above from then on, differs from what is
/// known: a row at a time, which stays in registers.
#[inline(always)]
fn differ<const GROUPS: usize>(
    above: &mut [Lanes; GROUPS],
    seen: &[u8],
    part: (f32, f32),
    known: &[[i16; LANES]],
) -> [Lanes; GROUPS] {
    let mut off = [[0.0; LANES]; GROUPS];
    next_row(above.as_flattened_mut(), &seen[..=GROUPS * LANES], part, off.as_flattened_mut());
    for (off, known) in off.as_flattened_mut().iter_mut().zip(known.as_flattened()) {
        *off = *off * SCALE - f32::from(*known);
    }
    off
}

/// A row `part` of the way from the one `above` to the one that is `seen`, which is the one above from then on.
#[inline(always)]
fn next_row(above: &mut [f32], seen: &[u8], part: (f32, f32), out: &mut [f32]) {
    let rows = above.as_chunks_mut::<LANES>().0.iter_mut().zip(out.as_chunks_mut::<LANES>().0);
    for (index, (above, out)) in rows.enumerate() {
        let below = across_lanes(&seen[index * LANES..], part.0);
        for lane in 0..LANES {
            out[lane] = above[lane] + part.1 * (below[lane] - above[lane]);
        }
        *above = below;
    }
}

/// The middle row of three and its gradients by Scharr's kernel, as OpenCV has it; none but in those `columns`.
#[inline(always)]
fn gradient<const GROUPS: usize>(
    rows: [&Row; 3],
    columns: Range<usize>,
    (known, right, down): (&mut [i16], &mut [i16], &mut [i16]),
    side: usize,
) {
    let (mut smoothed, mut steps, mut out) = (EMPTY, EMPTY, EMPTY);
    let count = GROUPS * LANES;
    combine(rows.map(|row| &row[..]), &mut smoothed[..count + LANES], |a, b, c| 3.0 * (a + c) + 10.0 * b);
    combine(rows.map(|row| &row[..]), &mut steps[..count + LANES], |a, _, c| c - a);
    combine([0, 1, 2].map(|first| &smoothed[first..]), &mut out[..count], |a, _, c| c - a);
    round(&out, SCALE / 32.0, right);
    combine([0, 1, 2].map(|first| &steps[first..]), &mut out[..count], |a, b, c| 3.0 * (a + c) + 10.0 * b);
    round(&out, SCALE / 32.0, down);
    round(&rows[1][1..], SCALE, known);
    let end = columns.end.min(side);
    let start = columns.start.min(end);
    known[side..].fill(0);
    for plane in [right, down] {
        plane[..start].fill(0);
        plane[end..].fill(0);
    }
}

/// Makes one row of three.
#[inline(always)]
fn combine([a, b, c]: [&[f32]; 3], out: &mut [f32], with: impl Fn(f32, f32, f32) -> f32) {
    let rows = a.as_chunks::<LANES>().0.iter().zip(b.as_chunks::<LANES>().0).zip(c.as_chunks::<LANES>().0);
    for (out, ((a, b), c)) in out.as_chunks_mut::<LANES>().0.iter_mut().zip(rows) {
        for lane in 0..LANES {
            out[lane] = with(a[lane], b[lane], c[lane]);
        }
    }
}

/// Adds the products of two rows, as many sums of them as numbers are worked on at once.
#[inline(always)]
fn add_products<T: Copy + Into<f32>>(row: &[T], gradient: &[i16], sums: &mut [f32; LANES]) {
    for (row, gradient) in row.as_chunks::<LANES>().0.iter().zip(gradient.as_chunks::<LANES>().0) {
        for lane in 0..LANES {
            let (value, gradient): (f32, f32) = (row[lane].into(), gradient[lane].into());
            sums[lane] += value * gradient;
        }
    }
}

/// The nearest whole numbers of values times a scale, each of at most 15 bits: these are left in the lower bits of a number so large that
/// it has no room for fractions.
#[inline(always)]
fn round(values: &[f32], scale: f32, out: &mut [i16]) {
    const NO_ROOM: f32 = 1.5 * (1 << 23) as f32;
    for (out, values) in out.as_chunks_mut::<LANES>().0.iter_mut().zip(values.as_chunks::<LANES>().0) {
        for lane in 0..LANES {
            out[lane] = (values[lane] * scale + NO_ROOM).to_bits() as i16;
        }
    }
}
