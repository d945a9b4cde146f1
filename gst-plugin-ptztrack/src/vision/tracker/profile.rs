// SPDX-License-Identifier: MPL-2.0

//! The two ways to follow a target, and all in which they differ: nobody else asks which of them it is.

use opencv::core::{Point2f, Rect2f};

use super::geometry::Frame;
use super::report::Detection;
use super::target::{Follow, Robust, Thesis};
use super::tracks::{Region, Track, body_at, people};
use crate::vision::Observation;

/// How a target is followed.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Profile {
    /// Thesis 3.5 as written: corners, optical flow, mean of the points, mean-shift.
    Thesis,
    /// With all that tells a person from the wall behind: see [`super`].
    #[default]
    Robust,
}

impl Profile {
    /// Whether the motion of the background is measured, and what stands out from it.
    pub fn sees_the_scene(self) -> bool {
        self == Self::Robust
    }

    /// Whether a motion detector's region is chosen only once it has travelled.
    pub fn must_travel(self) -> bool {
        self == Self::Robust
    }

    /// Adds the regions of a detection. The thesis takes it as it is, with its contour, in which it finds corners; else it is as many as
    /// there are heads. `memory` is for their boxes, and `outlines` are empty ones to be used again.
    pub(super) fn read(
        self,
        detection: &Detection,
        frame: Frame,
        (memory, outlines): (&mut Vec<Rect2f>, &mut Vec<Vec<Point2f>>),
        regions: &mut Vec<Region>,
    ) {
        let bounds = frame.rect_to_pixels(detection.bounds);
        let contour = detection.contour.iter().map(|point| frame.point_to_pixels(*point));
        memory.clear();
        match self {
            Self::Thesis => memory.push(bounds),
            Self::Robust => people(bounds, contour.clone(), memory),
        }
        regions.extend(memory.iter().map(|bounds| {
            let mut outline = outlines.pop().unwrap_or_default();
            outline.extend(contour.clone());
            Region::new(*bounds, outline, detection.outside)
        }));
    }

    /// The box of whom a click at `point` means in a region, which the thesis takes as it is.
    pub(super) fn body_at(self, point: Point2f, region: Rect2f) -> Rect2f {
        match self {
            Self::Thesis => region,
            Self::Robust => body_at(point, region),
        }
    }

    /// Takes up a track that is seen in `region`; `None` where there is nothing to follow.
    pub(super) fn acquire(
        self,
        seen: &Observation,
        track: &Track,
        region: Option<&Region>,
    ) -> opencv::Result<Option<Box<dyn Follow>>> {
        Ok(match self {
            Self::Thesis => {
                let contour = region.map_or(&[][..], |region| &region.contour);
                Thesis::acquire(&seen.luma, track, contour)?.map(|target| Box::new(target) as _)
            }
            Self::Robust => Robust::acquire(seen, track)?.map(|target| Box::new(target) as _),
        })
    }
}
