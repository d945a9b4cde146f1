// SPDX-License-Identifier: MPL-2.0

use std::ops::Range;

use multiversion::multiversion;

use super::Luma;
use super::bits::Bits;
use super::blur::mirrored;
use super::components::{Components, Run};
use super::morphology::clean;
use super::reflections::{Extent, Reflections};
use super::scene_model::SceneView;

/// Likelihood, averaged over 3x3 pixels, from which a pixel may belong to a region: just above that of what is
/// unknown ...
pub(super) const WEAK: u16 = 137;
/// ... and from which it makes one by itself.
const STRONG: u16 = 241;
/// Pixels that make a region, as a part of the picture: a few bright specks do not.
const MIN_STRONG: f64 = 1.0 / 8000.0;

/// Somebody whose reflection is seen: the number of their part, and where it may be.
#[derive(Debug)]
struct Reflected {
    number: usize,
    reflection: Extent,
}

/// Tells foreground from the likelihood of each pixel.
#[derive(Debug, Default)]
pub struct Segmentation {
    strong: Vec<u8>,
    bits: Bits,
    components: Components,
    reflections: Reflections,
    reflected: Vec<Reflected>,
    /// Of one row: sums of three pixels above each other.
    sums: Vec<u16>,
    /// Of a part's columns.
    heights: Vec<usize>,
}

impl Segmentation {
    /// The foreground as a `mask` of 255 and 0, of the size of `scene`: what is likely, cleaned by opening and closing
    /// (thesis 3.3.1), where part of it is sure (hysteresis, as Canny's edges have it). Shadows and reflections of somebody are not.
    pub fn segment(
        &mut self,
        scene: &SceneView,
        open_size: (usize, usize),
        close_size: (usize, usize),
        mask: &mut [u8],
    ) {
        let (width, height) = (scene.foreground.width(), scene.foreground.height());
        let needed = (MIN_STRONG * (width * height) as f64).ceil() as usize;
        if self.threshold(&scene.foreground, mask) < needed {
            mask.fill(0);
            return;
        }
        clean(mask, width, open_size, close_size, &mut self.bits);
        self.components.find(mask, width);
        self.reflected.clear();
        self.reflections.next_picture();
        for (number, runs) in self.components.parts().enumerate() {
            let columns = extent(runs.iter()).columns;
            let is_sure = holds(runs, &self.strong, width, needed);
            let kept = if is_sure { upright(runs, columns.clone(), &mut self.heights) } else { 0..0 };
            if kept != columns {
                keep(runs, &kept, mask, width);
            }
            let is_kept = |run: &&Run| run.columns.start < kept.end && kept.start < run.columns.end;
            let part = Extent { columns: kept.clone(), ..extent(runs.iter().filter(is_kept)) };
            // Parts come from top to bottom: whoever it is of came before.
            let is_reflection = self.reflected.iter().any(|reflected| reflected.reflection.holds(&part));
            if is_sure
                && !is_reflection
                && let Some(feet) = self.reflections.feet(&part, scene)
            {
                self.reflected.push(Reflected { number, reflection: part.reflection(feet) });
            }
        }
        if self.reflections.shines() {
            self.clear_reflections(mask, width);
        }
    }

    /// Forgets what was learned of the floor.
    pub fn restart(&mut self) {
        self.reflections = Reflections::default();
    }

    /// Clears the reflections in the mask: what hangs together with whoever it is of, and what lies by itself.
    fn clear_reflections(&self, mask: &mut [u8], width: usize) {
        let has_own = |part: usize| self.reflected.iter().any(|reflected| reflected.number == part);
        for Reflected { number: owner, reflection } in &self.reflected {
            for (number, runs) in self.components.parts().enumerate() {
                let by_itself = || !has_own(number) && reflection.holds(&extent(runs.iter()));
                if number == *owner || by_itself() {
                    for Run { row, columns, .. } in
                        runs.iter().filter(|run| reflection.rows.contains(&run.row))
                    {
                        mask[row * width..][columns.clone()].fill(0);
                    }
                }
            }
        }
    }

    /// Leaves what is likely in `mask` and what is sure in `strong`, and counts that.
    fn threshold(&mut self, likelihood: &Luma, mask: &mut [u8]) -> usize {
        let (width, height) = (likelihood.width(), likelihood.height());
        self.strong.resize(mask.len(), 0);
        let rows = mask.chunks_exact_mut(width.max(1)).zip(self.strong.chunks_exact_mut(width.max(1)));
        let count = rows.enumerate().map(|(y, (weak, strong))| {
            let around = [mirrored(y as isize - 1, height), y, mirrored(y as isize + 1, height)];
            threshold_row(around.map(|y| likelihood.row(y)), &mut self.sums, weak, strong)
        });
        count.sum()
    }
}

/// Marks in a row, of which and of its neighbours the likelihoods are given, what is likely and what is sure, by the means of
/// 3x3 pixels; counts what is sure. `sums` is memory.
#[multiversion(targets("x86_64+avx2"))]
fn threshold_row(
    [above, here, below]: [&[u8]; 3],
    sums: &mut Vec<u16>,
    weak: &mut [u8],
    strong: &mut [u8],
) -> usize {
    let width = here.len();
    sums.clear();
    sums.resize(width + 2, 0);
    for (sum, ((above, here), below)) in sums[1..=width].iter_mut().zip(above.iter().zip(here).zip(below)) {
        *sum = u16::from(*above) + u16::from(*here) + u16::from(*below);
    }
    (sums[0], sums[width + 1]) = (sums[1 + mirrored(-1, width)], sums[1 + mirrored(width as isize, width)]);
    let around = sums[..width].iter().zip(&sums[1..=width]).zip(&sums[2..]);
    // A mean is rounded: from so many on it is at least the limit.
    let least = |mean: u16| 9 * mean - 4;
    let mut count = 0_u16;
    for ((weak, strong), ((left, middle), right)) in weak.iter_mut().zip(strong.iter_mut()).zip(around) {
        let sum = left + middle + right;
        *weak = if sum >= least(WEAK) { u8::MAX } else { 0 };
        *strong = if sum >= least(STRONG) { u8::MAX } else { 0 };
        count += u16::from(sum >= least(STRONG));
    }
    usize::from(count)
}

/// Columns of a region with less than this part of its tallest one may be a shadow on the floor beside somebody upright ...
const LOW: f32 = 0.3;
/// ... and are one where they go on for so many heights of it: farther than a foot or a hand reaches.
const LONG: f32 = 0.25;

/// What there is of a part.
fn extent<'a>(runs: impl Iterator<Item = &'a Run> + Clone) -> Extent {
    let around = |start: Option<usize>, end: Option<usize>| start.unwrap_or(0)..end.unwrap_or(0);
    let (rows, columns) = (runs.clone().map(|run| run.row), runs.map(|run| &run.columns));
    Extent {
        rows: around(rows.clone().min(), rows.max().map(|last| last + 1)),
        columns: around(columns.clone().map(|run| run.start).min(), columns.map(|run| run.end).max()),
    }
}

/// Whether so many pixels of a part are set in another mask, whose rows are `width` pixels.
fn holds(runs: &[Run], other: &[u8], width: usize, needed: usize) -> bool {
    let mut count = 0;
    // A few rows of somebody are enough.
    runs.iter().any(|run| {
        let pixels = &other[run.row * width..][run.columns.clone()];
        count += pixels.iter().filter(|pixel| **pixel > 0).count();
        count >= needed
    })
}

/// The `columns` of a part without a long low tail on either side: somebody stands upright, and their shadow lies (by the heights of
/// columns, as Hsieh et al., "Shadow elimination for effective moving object detection", 2003). `heights` is memory.
fn upright(runs: &[Run], columns: Range<usize>, heights: &mut Vec<usize>) -> Range<usize> {
    heights.clear();
    heights.resize(columns.len(), 0);
    for run in runs {
        let heights = &mut heights[run.columns.start - columns.start..run.columns.end - columns.start];
        heights.iter_mut().for_each(|height| *height += 1);
    }
    let tallest = heights.iter().copied().max().unwrap_or(0) as f32;
    let low = |height: &&usize| (**height as f32) < LOW * tallest;
    let long = |tail: usize| if tail as f32 >= LONG * tallest { tail } else { 0 };
    let before = long(heights.iter().take_while(low).count());
    let after = long(heights.iter().rev().take_while(low).count());
    columns.start + before..columns.end - after
}

/// Clears a part in the mask but for those columns.
fn keep(runs: &[Run], kept: &Range<usize>, mask: &mut [u8], width: usize) {
    for Run { row, columns, .. } in runs {
        let pixels = &mut mask[row * width..][columns.clone()];
        let before = kept.start.clamp(columns.start, columns.end) - columns.start;
        let after = kept.end.clamp(columns.start, columns.end) - columns.start;
        pixels[..before].fill(0);
        pixels[before.max(after)..].fill(0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: (usize, usize) = (160, 100);

    /// Left, top, width, height in pixels.
    type Pixels = (usize, usize, usize, usize);

    /// Likelihoods of 20 with boxes of others; how many pixels are segmented.
    fn segmented(boxes: &[(Pixels, u8)]) -> i32 {
        opened(boxes, (1, 3))
    }

    /// The same with an opening of that size.
    fn opened(boxes: &[(Pixels, u8)], open_size: (usize, usize)) -> i32 {
        let mut likelihood = vec![20; SIZE.0 * SIZE.1];
        for ((x, y, width, height), value) in boxes {
            for row in likelihood.chunks_exact_mut(SIZE.0).skip(*y).take(*height) {
                row[*x..x + width].fill(*value);
            }
        }
        let mut mask = vec![0; SIZE.0 * SIZE.1];
        let luma = Luma::packed(&likelihood, SIZE.0);
        let scene = SceneView::of_greys(luma, luma, luma);
        Segmentation::default().segment(&scene, open_size, (3, 7), &mut mask);
        mask.iter().map(|pixel| i32::from(*pixel > 0)).sum()
    }

    #[test]
    fn what_is_likely_counts_beside_what_is_sure() {
        let (body, head) = ((50, 40, 12, 40), (53, 30, 6, 10));
        assert_eq!(segmented(&[(body, 180)]), 0, "likely only");
        let alone = segmented(&[(head, 255)]);
        let both = segmented(&[(body, 180), (head, 255)]);
        assert!(alone > 40 && both > 400, "{alone} {both}");
    }

    /// What is segmented below the feet of somebody on a floor that reflects 30 % of what is above it, once the floor is known to shine, where
    /// their reflection is likely from this row on.
    fn segmented_of_reflection(likely_from: usize) -> i32 {
        let (top, feet) = (8, 48);
        let mut picture = vec![120; SIZE.0 * SIZE.1];
        let (background, mut likelihood) = (picture.clone(), vec![20; SIZE.0 * SIZE.1]);
        for row in top..feet {
            let worn = if row < 26 { 200 } else { 50 };
            let mirrored = 2 * feet - 1 - row;
            for column in if row < 26 { 70..86 } else { 73..83 } {
                picture[row * SIZE.0 + column] = worn;
                picture[mirrored * SIZE.0 + column] = (120 + 3 * (i32::from(worn) - 120) / 10) as u8;
                likelihood[row * SIZE.0 + column] = 255;
                likelihood[mirrored * SIZE.0 + column] = if mirrored >= likely_from { 255 } else { 20 };
            }
        }
        let [luma, background, foreground] =
            [&picture, &background, &likelihood].map(|plane| Luma::packed(plane, SIZE.0));
        let scene = SceneView::of_greys(luma, background, foreground);
        let (mut segmentation, mut mask) = (Segmentation::default(), vec![0; SIZE.0 * SIZE.1]);
        let below = |mask: &[u8]| mask[(feet + 2) * SIZE.0..].iter().map(|pixel| i32::from(*pixel > 0)).sum();
        segmentation.segment(&scene, (1, 3), (3, 7), &mut mask);
        let first: i32 = below(&mask);
        assert!(first > 200, "one picture tells nothing of the floor: {first}");
        for _ in 0..40 {
            segmentation.segment(&scene, (1, 3), (3, 7), &mut mask);
        }
        assert!(mask[top * SIZE.0..feet * SIZE.0].iter().filter(|pixel| **pixel > 0).count() > 500);
        below(&mask)
    }

    #[test]
    fn where_the_floor_shines_reflections_are_nobody() {
        assert_eq!(segmented_of_reflection(48), 0, "with whoever it is of");
        assert_eq!(segmented_of_reflection(58), 0, "by itself");
    }

    #[test]
    fn an_upright_opening_leaves_narrow_limbs_and_takes_what_is_low() {
        let (body, limb, edge) = (((50, 20, 12, 30), 255), ((54, 50, 2, 20), 255), ((62, 40, 10, 2), 255));
        let both = segmented(&[body, limb]);
        assert!(both >= opened(&[body, limb], (5, 5)) + 30, "a limb");
        assert!(segmented(&[body, limb, edge]) < both + 6, "an edge");
        assert!(opened(&[body, limb, edge], (1, 1)) > both + 12, "an edge, without opening");
    }

    #[test]
    fn somebody_leaves_their_shadow_behind_and_keeps_their_feet() {
        let (body, shadow, foot) = ((50, 20, 14, 60), (10, 72, 40, 6), (64, 74, 6, 6));
        let alone = segmented(&[(body, 255)]);
        assert!((segmented(&[(body, 255), (shadow, 255)]) - alone).abs() < 30, "a shadow");
        assert!(segmented(&[(body, 255), (foot, 255)]) > alone + 15, "a foot");
        let beside = (80, 25, 14, 60);
        assert!(segmented(&[(body, 255), (shadow, 255), (beside, 255)]) > 2 * alone - 60, "somebody beside");
    }

    #[test]
    fn specks_and_the_unknown_are_no_regions() {
        assert_eq!(segmented(&[((20, 20, 1, 1), 255), ((90, 60, 2, 1), 255)]), 0);
        assert_eq!(segmented(&[((0, 0, 160, 100), 128)]), 0);
    }
}
