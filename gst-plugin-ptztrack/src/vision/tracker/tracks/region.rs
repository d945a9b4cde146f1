// SPDX-License-Identifier: MPL-2.0

use opencv::core::{Point2f, Rect2f};

use super::looks::Looks;
use crate::vision::tracker::outline::{crossings, is_inside};

/// Something that a detector saw in one picture, and whose it is. Pixels of the picture.
#[derive(Debug, Clone, Default, PartialEq)]
pub(in super::super) struct Region {
    pub bounds: Rect2f,
    /// Polygon around it, and around whoever is seen with it; empty where only the box is known.
    pub contour: Vec<Point2f>,
    /// Whether it lies where nobody is to be chosen.
    pub outside: bool,
    /// How much of it lies where much changed before and nothing came of it: 0 to 1.
    pub restless: f32,
    pub(super) looks: Looks,
    /// Whether any track is seen in it.
    pub(super) is_owned: bool,
}

impl Region {
    /// Of which nobody is the owner yet.
    pub fn new(bounds: Rect2f, contour: Vec<Point2f>, outside: bool) -> Self {
        Self { bounds, contour, outside, ..Self::default() }
    }

    /// Whether it shows something at a place, and not only around it.
    pub fn shows(&self, place: Point2f) -> bool {
        self.bounds.contains(place) && is_inside(crossings(&self.contour, place.y), place.x)
    }
}
