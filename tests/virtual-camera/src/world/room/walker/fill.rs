// SPDX-License-Identifier: MPL-2.0

//! Filling triangles: which samples lie inside, and what runs over them linearly.

/// What a corner of a triangle carries.
pub(super) const CARRIED: usize = 4;

/// A corner in samples, whose centres are at whole numbers.
#[derive(Debug, Clone, Copy)]
pub(super) struct Corner {
    pub x: f32,
    pub y: f32,
    pub carried: [f32; CARRIED],
}

/// Calls `each` with every row's first sample, its end, what the corners carry there, and its step from sample to sample.
///
/// Triangles that share an edge share no sample and leave none out.
pub(super) fn triangle(
    corners: [Corner; 3],
    size: (usize, usize),
    mut each: impl FnMut(usize, usize, [f32; CARRIED], &[f32; CARRIED]),
) {
    let [a, b, c] = corners;
    let area = (b.x - a.x) * (c.y - a.y) - (c.x - a.x) * (b.y - a.y);
    if area.abs() < 1e-9 {
        return;
    }
    let mut order = corners;
    order.sort_by(|one, other| one.y.total_cmp(&other.y));
    let [top, middle, bottom] = order;
    let mut right = [0.0; CARRIED];
    let mut down = [0.0; CARRIED];
    for index in 0..CARRIED {
        let (first, second) = (b.carried[index] - a.carried[index], c.carried[index] - a.carried[index]);
        right[index] = (first * (c.y - a.y) - second * (b.y - a.y)) / area;
        down[index] = (second * (b.x - a.x) - first * (c.x - a.x)) / area;
    }
    let on = |from: Corner, to: Corner, y: f32| from.x + (to.x - from.x) * ((y - from.y) / (to.y - from.y));
    // The next whole number, as `ceil` is a call on processors without SSE 4.1.
    let limit = |place: f32, end: usize| {
        let inside = place.clamp(0.0, end as f32);
        let below = inside as usize;
        below + usize::from(below as f32 != inside)
    };
    for row in limit(top.y, size.1)..limit(bottom.y, size.1) {
        let y = row as f32;
        let long = on(top, bottom, y);
        let short = if y < middle.y { on(top, middle, y) } else { on(middle, bottom, y) };
        let (start, end) = (limit(long.min(short), size.0), limit(long.max(short), size.0));
        if start < end {
            let (x, y) = (start as f32 - a.x, y - a.y);
            let first = std::array::from_fn(|index| a.carried[index] + right[index] * x + down[index] * y);
            each(row * size.0 + start, row * size.0 + end, first, &right);
        }
    }
}
