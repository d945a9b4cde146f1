// SPDX-License-Identifier: MPL-2.0

use std::sync::Arc;

use super::{Output, Profile, RegionSelection, Test};
use crate::vision::{DetectorConfig, ForegroundTest, RegionChoice, ZoneError, Zones};

/// Polygons as written and as read.
#[derive(Debug, Clone, Default)]
pub(super) struct ZoneSetting {
    pub text: Arc<str>,
    zones: Zones,
}

impl std::str::FromStr for ZoneSetting {
    type Err = ZoneError;

    fn from_str(text: &str) -> Result<Self, ZoneError> {
        Ok(Self { text: text.into(), zones: text.parse()? })
    }
}

#[derive(Debug, Clone)]
pub(super) struct Settings {
    pub profile: Profile,
    pub analysis_width: u32,
    pub alpha: f64,
    pub test: Test,
    pub threshold: f64,
    pub spread_factor: f64,
    pub window: u32,
    pub open_size: i32,
    pub close_size: i32,
    pub selection: RegionSelection,
    pub min_area: f64,
    pub max_area: f64,
    pub zones: ZoneSetting,
    pub exclude_zones: ZoneSetting,
    pub warm_up: u32,
    pub confirm_frames: u32,
    pub settle_time_ns: u64,
    pub max_gap_ns: u64,
    pub end_delay_ns: u64,
    pub post_messages: bool,
    pub output: Output,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            profile: Profile::default(),
            analysis_width: 400,
            alpha: 0.5,
            test: Test::default(),
            threshold: 0.15,
            spread_factor: 3.0,
            window: 25,
            open_size: -1,
            close_size: -1,
            selection: RegionSelection::default(),
            min_area: 0.001,
            max_area: 0.8,
            zones: ZoneSetting::default(),
            exclude_zones: ZoneSetting::default(),
            warm_up: 10,
            confirm_frames: 3,
            settle_time_ns: 500_000_000,
            max_gap_ns: 1_000_000_000,
            end_delay_ns: 1_000_000_000,
            post_messages: true,
            output: Output::default(),
        }
    }
}

impl Settings {
    /// What the detector goes by.
    pub fn detector(&self) -> DetectorConfig {
        let test = match self.test {
            Test::Relative => ForegroundTest::Relative { threshold: self.threshold },
            Test::Spread => {
                ForegroundTest::Spread { factor: self.spread_factor, window: self.window as usize }
            }
        };
        let config = DetectorConfig {
            analysis_width: self.analysis_width as usize,
            alpha: self.alpha,
            test,
            open_size: usize::try_from(self.open_size).ok(),
            close_size: usize::try_from(self.close_size).ok(),
            choice: match self.selection {
                RegionSelection::LargestPerimeter => RegionChoice::LargestPerimeter,
                RegionSelection::All => RegionChoice::All,
            },
            min_area: self.min_area,
            max_area: self.max_area,
            zones: self.zones.zones.clone(),
            exclude_zones: self.exclude_zones.zones.clone(),
            warm_up: self.warm_up,
            confirm_pictures: self.confirm_frames,
        };
        match self.profile {
            Profile::Robust => config,
            Profile::Thesis => as_in_the_thesis(config),
        }
    }
}

/// Side of the square that the thesis opens and closes with, in pixels; it names none, so the smallest there is.
const THESIS_SQUARE: usize = 3;

/// Thesis 3.2 to 3.4 and no more: every picture is looked at as it comes, both elements are square, and a region counts as soon as it
/// is seen.
fn as_in_the_thesis(config: DetectorConfig) -> DetectorConfig {
    DetectorConfig {
        analysis_width: 0,
        open_size: config.open_size.or(Some(THESIS_SQUARE)),
        close_size: config.close_size.or(Some(THESIS_SQUARE)),
        confirm_pictures: 1,
        choice: RegionChoice::LargestPerimeter,
        ..config
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_thesis_has_none_of_our_steps_and_keeps_what_it_leaves_open() {
        let thesis = Settings { profile: Profile::Thesis, threshold: 0.2, ..Settings::default() }.detector();
        assert_eq!((thesis.analysis_width, thesis.confirm_pictures), (0, 1));
        assert_eq!((thesis.open_size, thesis.close_size), (Some(3), Some(3)));
        assert_eq!(thesis.test, ForegroundTest::Relative { threshold: 0.2 });
        let larger = Settings { profile: Profile::Thesis, close_size: 9, ..Settings::default() };
        assert_eq!(larger.detector().close_size, Some(9));
        assert_ne!(Settings::default().detector(), thesis);
    }
}
