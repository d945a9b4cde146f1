// SPDX-License-Identifier: MPL-2.0

//! From VAPIX speed steps to degrees per second.

/// How a speed step (1 to 100) becomes a speed: every product has its own curve.
#[derive(Debug, Clone, PartialEq)]
pub enum SpeedMap {
    /// In proportion to the step.
    Linear {
        /// Degrees per second at step 100.
        max_deg_s: f64,
    },
    /// By the cube of the step, never below a floor: the curve of the example table in Axis' own documentation.
    Cubic {
        /// Degrees per second at step 100.
        max_deg_s: f64,
        /// Degrees per second at step 1.
        floor_deg_s: f64,
    },
    /// Straight lines between pairs of step and degrees per second, steps increasing; a step below the first is the first.
    Table(Vec<(f64, f64)>),
}

impl SpeedMap {
    /// Degrees per second at `step` (−100 to 100), with its sign; step 0 is at rest.
    pub fn deg_s(&self, step: f64) -> f64 {
        let size = step.abs().min(100.0);
        if size == 0.0 {
            return 0.0;
        }
        let speed = match self {
            Self::Linear { max_deg_s } => max_deg_s * size / 100.0,
            Self::Cubic { max_deg_s, floor_deg_s } => (max_deg_s * (size / 100.0).powi(3)).max(*floor_deg_s),
            Self::Table(points) => interpolate(points, size),
        };
        speed.copysign(step)
    }
}

fn interpolate(points: &[(f64, f64)], x: f64) -> f64 {
    let above = points.partition_point(|point| point.0 < x);
    match (above.checked_sub(1).and_then(|below| points.get(below)), points.get(above)) {
        (Some(&(x0, y0)), Some(&(x1, y1))) => y0 + (y1 - y0) * (x - x0) / (x1 - x0),
        (Some(&(_, y)), None) | (None, Some(&(_, y))) => y,
        (None, None) => 0.0,
    }
}

/// Whether the top speed falls as the view narrows (`PTZ.Various.V1.ProportionalSpeedEnabled`).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ProportionalSpeed {
    /// On in every recorded Axis dome.
    pub enabled: bool,
    /// Fields of view per second at most (`MaxProportionalSpeed` / 100).
    pub max_fields_s: f64,
    /// What becomes of the speeds below: undocumented, so both are here.
    pub rule: ProportionalRule,
}

/// How proportional speed keeps below its maximum.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ProportionalRule {
    /// Speeds above the maximum become the maximum; those below stay.
    Cap,
    /// Step 100 becomes the maximum, all others shrink in proportion.
    Scale,
}

impl ProportionalSpeed {
    /// `speed_deg_s` of a motor that does `top_deg_s` at step 100, at a horizontal field of view of `fov_deg`.
    pub fn apply(&self, speed_deg_s: f64, top_deg_s: f64, fov_deg: f64) -> f64 {
        let most = self.max_fields_s * fov_deg;
        if !self.enabled || top_deg_s <= most {
            return speed_deg_s;
        }
        match self.rule {
            ProportionalRule::Cap => speed_deg_s.clamp(-most, most),
            ProportionalRule::Scale => speed_deg_s * most / top_deg_s,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn near(found: f64, expected: f64) {
        assert!((found - expected).abs() < 1e-9, "{found} instead of {expected}");
    }

    #[test]
    fn cubic_map_has_the_documented_shape() {
        let map = SpeedMap::Cubic { max_deg_s: 150.0, floor_deg_s: 0.05 };
        near(map.deg_s(100.0), 150.0);
        near(map.deg_s(58.0), 29.266_8);
        near(map.deg_s(-40.0), -9.6);
        near(map.deg_s(24.0), 2.073_6);
        near(map.deg_s(1.0), 0.05);
        near(map.deg_s(-1.0), -0.05);
        near(map.deg_s(0.0), 0.0);
    }

    #[test]
    fn linear_map_is_a_line() {
        let map = SpeedMap::Linear { max_deg_s: 450.0 };
        near(map.deg_s(50.0), 225.0);
        near(map.deg_s(-100.0), -450.0);
        near(map.deg_s(300.0), 450.0);
    }

    #[test]
    fn table_interpolates_and_holds_its_ends() {
        let map = SpeedMap::Table(vec![(10.0, 1.0), (20.0, 3.0), (90.0, 17.0)]);
        near(map.deg_s(5.0), 1.0);
        near(map.deg_s(15.0), 2.0);
        near(map.deg_s(-20.0), -3.0);
        near(map.deg_s(55.0), 10.0);
        near(map.deg_s(100.0), 17.0);
        near(SpeedMap::Table(vec![]).deg_s(50.0), 0.0);
    }

    #[test]
    fn proportional_speed_caps_or_scales() {
        let mut proportional =
            ProportionalSpeed { enabled: true, max_fields_s: 2.0, rule: ProportionalRule::Cap };
        near(proportional.apply(450.0, 450.0, 55.0), 110.0);
        near(proportional.apply(-450.0, 450.0, 3.2), -6.4);
        near(proportional.apply(56.0, 450.0, 55.0), 56.0);
        proportional.rule = ProportionalRule::Scale;
        near(proportional.apply(225.0, 450.0, 55.0), 55.0);
        proportional.enabled = false;
        near(proportional.apply(225.0, 450.0, 55.0), 225.0);
    }
}
