// SPDX-License-Identifier: MPL-2.0

use crate::Step;

/// Which sightings are asked for; by default all.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Filter {
    /// Those that were not over before, in milliseconds since 1970.
    pub since_ms: Option<i64>,
    /// Those that had begun by then.
    pub until_ms: Option<i64>,
    /// Those of this camera.
    pub camera: Option<String>,
    /// Those that went through there.
    pub area: Option<Area>,
    /// No more than so many, the latest.
    pub most: Option<usize>,
}

/// A part of what a camera can see, in degrees; it may lie across the seam of pan, as from 170 to -170.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Area {
    /// From the left to the right.
    pub pan_deg: (f64, f64),
    /// From the bottom to the top.
    pub tilt_deg: (f64, f64),
}

impl Area {
    /// Whether somebody who went that way was in it.
    pub fn saw(&self, path: &[Step]) -> bool {
        path.iter().any(|step| self.has(step.pan_deg, step.tilt_deg))
    }

    fn has(&self, pan_deg: f64, tilt_deg: f64) -> bool {
        let (left, right) = self.pan_deg;
        let after_left = (pan_deg - left).rem_euclid(360.0);
        let is_all_around = right - left >= 360.0;
        (is_all_around || after_left <= (right - left).rem_euclid(360.0))
            && (self.tilt_deg.0..=self.tilt_deg.1).contains(&tilt_deg)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_area_may_lie_across_the_seam() {
        let area = |left, right| Area { pan_deg: (left, right), tilt_deg: (-20.0, 0.0) };
        assert!(area(-10.0, 10.0).has(0.0, -5.0) && !area(-10.0, 10.0).has(20.0, -5.0));
        assert!(area(170.0, -170.0).has(-179.0, -5.0) && !area(170.0, -170.0).has(0.0, -5.0));
        assert!(!area(-10.0, 10.0).has(0.0, 5.0));
        assert!(area(-180.0, 180.0).has(0.0, -5.0) && area(0.0, 360.0).has(-90.0, -5.0));
        assert!(area(10.0, 10.0).has(10.0, -5.0) && !area(10.0, 10.0).has(11.0, -5.0));
    }
}
