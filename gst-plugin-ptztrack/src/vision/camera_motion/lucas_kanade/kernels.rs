// SPDX-License-Identifier: MPL-2.0

//! What is done with every pixel of a window.
//!
//! A row of a template holds what is known, its gradient to the right and its gradient downwards, one after the other, each in
//! [`SCALE`]ths of a grey level and filled up with zeros to whole [`LANES`].

use std::ops::Range;

use multiversion::multiversion;

use super::{LANES, MAX_ROW, MAX_SIDE};

/// Parts of a grey level that a template tells apart.
const SCALE: f32 = 64.0;

/// Numbers in a row of a template.
pub(super) fn row_length(side: usize) -> usize {
    3 * side.next_multiple_of(LANES)
}

/// A row of numbers; as long as is needed.
type Row = [f32; MAX_ROW];
const EMPTY: Row = [0.0; MAX_ROW];

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
    let lanes = side.next_multiple_of(LANES);
    let count = (side + 2).next_multiple_of(LANES);
    let (mut above, mut below) = (EMPTY, EMPTY);
    let mut last = [EMPTY; 3];
    let mut sums = [[0.0; LANES]; 3];
    across(seen, part.0, &mut above[..count]);
    for y in 0..side + 2 {
        across(&seen[(y + 1) * stride..], part.0, &mut below[..count]);
        last.rotate_left(1);
        between(&above[..count], &below[..count], part.1, &mut last[2][..count]);
        std::mem::swap(&mut above, &mut below);
        let Some(row) = y.checked_sub(2) else { continue };
        let (known, gradients) = rows[row * 3 * lanes..][..3 * lanes].split_at_mut(lanes);
        let (right, down) = gradients.split_at_mut(lanes);
        let columns = if inside.1.contains(&row) { inside.0.clone() } else { 0..0 };
        gradient(&last, columns, (&mut *known, &mut *right, &mut *down), side);
        let [xx, xy, yy] = &mut sums;
        add_products(right, right, xx);
        add_products(right, down, xy);
        add_products(down, down, yy);
    }
    sums.map(|sums| per_pixel(sums.iter().sum(), side))
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
    let off = differ::<GROUPS>(rows, seen, stride, part);
    let mut sums = [[0.0; LANES]; 2];
    // Each by itself: a loop that adds to both is not made one of whole registers.
    for (first, sums) in [GROUPS, 2 * GROUPS].into_iter().zip(&mut sums) {
        for (off, row) in off.iter().zip(rows.as_chunks::<LANES>().0.chunks_exact(3 * GROUPS)) {
            add_products(off.as_flattened(), row[first..first + GROUPS].as_flattened(), sums);
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
    let off = differ::<GROUPS>(rows, seen, stride, part);
    let row =
        |off: &[[f32; LANES]; GROUPS]| off.as_flattened()[..side].iter().map(|off| off.abs()).sum::<f32>();
    off[..side].iter().map(row).sum()
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

/// How the rows of a window, each so many `GROUPS` of lanes, differ from what is known.
#[inline(always)]
fn differ<const GROUPS: usize>(
    rows: &[i16],
    seen: &[u8],
    stride: usize,
    part: (f32, f32),
) -> [[[f32; LANES]; GROUPS]; MAX_SIDE] {
    let mut off = [[[0.0; LANES]; GROUPS]; MAX_SIDE];
    let mut above = [[0.0; LANES]; GROUPS];
    for (group, above) in above.iter_mut().enumerate() {
        *above = across_lanes(&seen[group * LANES..], part.0);
    }
    let known = rows.as_chunks::<LANES>().0.chunks_exact(3 * GROUPS);
    for (y, (off, known)) in off.iter_mut().zip(known).enumerate() {
        let seen = &seen[(y + 1) * stride..][..=GROUPS * LANES];
        for group in 0..GROUPS {
            let below = across_lanes(&seen[group * LANES..], part.0);
            for lane in 0..LANES {
                let value = above[group][lane] + part.1 * (below[lane] - above[group][lane]);
                off[group][lane] = value * SCALE - f32::from(known[group][lane]);
            }
            above[group] = below;
        }
    }
    off
}

/// A row `part` of the way from one to the next.
#[inline(always)]
fn between(above: &[f32], below: &[f32], part: f32, out: &mut [f32]) {
    let rows = above.as_chunks::<LANES>().0.iter().zip(below.as_chunks::<LANES>().0);
    for (out, (above, below)) in out.as_chunks_mut::<LANES>().0.iter_mut().zip(rows) {
        for lane in 0..LANES {
            out[lane] = above[lane] + part * (below[lane] - above[lane]);
        }
    }
}

/// The middle row of three and its gradients by Scharr's kernel, as OpenCV has it; none but in those `columns`.
#[inline(always)]
fn gradient(
    rows: &[Row; 3],
    columns: Range<usize>,
    (known, right, down): (&mut [i16], &mut [i16], &mut [i16]),
    side: usize,
) {
    let count = known.len() + 2;
    let [a, b, c] = rows.each_ref().map(|row| &row[..count]);
    let (mut smoothed, mut steps, mut out) = (EMPTY, EMPTY, EMPTY);
    for ((smoothed, b), (a, c)) in smoothed.iter_mut().zip(b).zip(a.iter().zip(c)) {
        *smoothed = 3.0 * (a + c) + 10.0 * b;
    }
    for (step, (a, c)) in steps.iter_mut().zip(a.iter().zip(c)) {
        *step = c - a;
    }
    for (out, (before, after)) in out.iter_mut().zip(smoothed.iter().zip(&smoothed[2..count])) {
        *out = after - before;
    }
    round(&out, SCALE / 32.0, right);
    for (out, (before, (here, after))) in
        out.iter_mut().zip(steps.iter().zip(steps[1..].iter().zip(&steps[2..count])))
    {
        *out = 3.0 * (before + after) + 10.0 * here;
    }
    round(&out, SCALE / 32.0, down);
    round(&b[1..], SCALE, known);
    let end = columns.end.min(side);
    let start = columns.start.min(end);
    known[side..].fill(0);
    for plane in [right, down] {
        plane[..start].fill(0);
        plane[end..].fill(0);
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
    for (out, value) in out.iter_mut().zip(values) {
        *out = (value * scale + NO_ROOM).to_bits() as i16;
    }
}
