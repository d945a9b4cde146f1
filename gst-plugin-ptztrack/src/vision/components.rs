// SPDX-License-Identifier: MPL-2.0

//! The connected parts of a mask, as runs of pixels: a run is joined to those in the row above that it touches, corners included
//! (Rosenfeld and Pfaltz, "Sequential operations in digital picture processing", 1966). Only what is white is looked at twice.

use std::ops::Range;

/// White pixels side by side.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Run {
    pub row: usize,
    pub columns: Range<usize>,
    /// The number of a run of the same part, or its own.
    part: usize,
}

/// The parts of a mask; kept as memory for the next mask.
#[derive(Debug, Default)]
pub(super) struct Components {
    runs: Vec<Run>,
}

impl Components {
    /// Finds those of a mask of 255 and 0, whose rows are `width` pixels.
    pub fn find(&mut self, mask: &[u8], width: usize) {
        self.runs.clear();
        let mut above = 0..0;
        for (y, row) in mask.chunks_exact(width.max(1)).enumerate() {
            let first = self.runs.len();
            add_runs(row, y, &mut self.runs);
            self.join(above, first);
            above = first..self.runs.len();
        }
        for index in 0..self.runs.len() {
            self.runs[index].part = self.root(index);
        }
        self.runs.sort_unstable_by_key(|run| run.part);
    }

    /// The runs of each part.
    pub fn parts(&self) -> impl Iterator<Item = &[Run]> {
        self.runs.chunk_by(|a, b| a.part == b.part)
    }

    /// Joins the runs from `first` on to those `above` that they touch.
    fn join(&mut self, mut above: Range<usize>, first: usize) {
        for lower in first..self.runs.len() {
            let Range { start, end } = self.runs[lower].columns;
            while above.clone().next().is_some_and(|upper| self.runs[upper].columns.end < start) {
                above.start += 1;
            }
            for upper in above.clone() {
                if self.runs[upper].columns.start > end {
                    break;
                }
                let (a, b) = (self.root(upper), self.root(lower));
                self.runs[a.max(b)].part = a.min(b);
            }
        }
    }

    /// The first run of a part, as far as it is known.
    fn root(&mut self, mut index: usize) -> usize {
        while self.runs[index].part != index {
            // Half the way for the next time.
            self.runs[index].part = self.runs[self.runs[index].part].part;
            index = self.runs[index].part;
        }
        index
    }
}

/// Adds the runs of a row of 255 and 0.
fn add_runs(row: &[u8], y: usize, runs: &mut Vec<Run>) {
    let mut start = None;
    let mut change = |x: usize| match start.take() {
        Some(start) => runs.push(Run { row: y, columns: start..x, part: runs.len() }),
        None => start = Some(x),
    };
    let (eights, rest) = row.as_chunks::<8>();
    // What is beyond the border is black.
    let mut last = [0; 8];
    last[..rest.len()].copy_from_slice(rest);
    let mut before = 0;
    for (index, eight) in eights.iter().chain([&last]).enumerate() {
        let pixels = u64::from_le_bytes(*eight);
        let mut changes = pixels ^ (pixels << 8 | before);
        before = pixels >> 56;
        while changes != 0 {
            let first = changes.trailing_zeros() / 8;
            change(8 * index + first as usize);
            changes &= !(0xff << (8 * first));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use opencv::core::Mat;
    use opencv::imgproc;
    use opencv::prelude::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn they_are_those_of_opencv(
            width in 1usize..90, pixels in prop::collection::vec(prop::bool::weighted(0.55), 400),
        ) {
            let mask: Vec<u8> =
                pixels[..400 / width * width].iter().map(|set| if *set { 255 } else { 0 }).collect();
            let picture = Mat::new_rows_cols_with_bytes::<u8>((400 / width) as i32, width as i32, &mask).unwrap();
            let mut labels = Mat::default();
            let count = imgproc::connected_components_def(&picture, &mut labels).unwrap();
            let labels = labels.data_typed::<i32>().unwrap();
            let mut components = Components::default();
            components.find(&mask, width);
            prop_assert_eq!(components.parts().count(), count as usize - 1);
            for part in components.parts() {
                let pixels = || part.iter().flat_map(|run| run.columns.clone().map(|x| run.row * width + x));
                let label = labels[pixels().next().unwrap()];
                prop_assert!(label > 0 && pixels().all(|at| labels[at] == label));
                prop_assert_eq!(pixels().count(), labels.iter().filter(|other| **other == label).count());
            }
        }
    }

    #[test]
    fn nothing_has_no_parts() {
        let mut components = Components::default();
        for (mask, width) in [(&[][..], 0), (&[][..], 5), (&[0; 12][..], 4)] {
            components.find(mask, width);
            assert_eq!(components.parts().count(), 0);
        }
    }
}
