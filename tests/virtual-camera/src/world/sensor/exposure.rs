// SPDX-License-Identifier: MPL-2.0

//! The exposure control: how a camera chooses shutter and gain by itself.

use std::sync::Mutex;

use crate::sync::lock;

/// Mean luma that the control leaves as it is; beyond it goes to the nearer end.
pub(super) const MEAN: (f64, f64) = (68.0, 102.0);
/// How many times as long as set the shutter may be open, at least and at most. At 25 pictures a second and the
/// usual 1/60 s the longest is 33 ms.
const SHUTTER: (f64, f64) = (1.0 / 16.0, 2.0);
/// The largest gain: 30 dB.
const GAIN: f64 = 32.0;
/// Of the difference to where it should be, 63 % are gone after so many seconds.
const SETTLING_S: f64 = 0.8;

/// How the sensor is set for one picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Setting {
    /// How many times as long as set the shutter is open.
    pub shutter: f64,
    /// How many times what the sensor counts is enlarged.
    pub gain: f64,
}

impl Setting {
    /// The setting that makes pictures 2^`stops` times as bright: first by the shutter, then by the gain.
    pub fn of(stops: f64) -> Self {
        let brighter = stops.exp2();
        let shutter = brighter.clamp(SHUTTER.0, SHUTTER.1);
        Self { shutter, gain: (brighter / shutter).clamp(1.0, GAIN) }
    }
}

/// The control of one camera, from picture to picture.
#[derive(Debug, Default)]
pub(super) struct Control {
    state: Mutex<Option<State>>,
}

#[derive(Debug, Clone, Copy)]
struct State {
    /// Of the newest picture, in seconds.
    time_s: f64,
    /// How it was set for that.
    stops: f64,
    /// How it should have been.
    wanted: f64,
}

impl State {
    fn stops_at(&self, time_s: f64) -> f64 {
        let left = (-(time_s - self.time_s).max(0.0) / SETTLING_S).exp();
        self.wanted + (self.stops - self.wanted) * left
    }
}

impl Control {
    /// How it is set at a time in seconds; `None` before the first picture.
    pub fn stops_at(&self, time_s: f64) -> Option<f64> {
        lock(&self.state).as_ref().map(|state| state.stops_at(time_s))
    }

    /// How it is set for the picture at a time, whose mean luma is `mean` of the stops; it learns from that for those that
    /// come later. A camera that has been on for long is set as it should be at its first picture.
    pub fn meter(&self, time_s: f64, mean: impl Fn(f64) -> f64) -> f64 {
        let mut state = lock(&self.state);
        let stops = state.as_ref().map_or_else(|| wanted(0.0, &mean), |state| state.stops_at(time_s));
        if state.as_ref().is_none_or(|state| state.time_s < time_s) {
            *state = Some(State { time_s, stops, wanted: wanted(stops, &mean) });
        }
        stops
    }
}

/// The stops nearest to `stops` that bring the mean luma into its range, or as near as shutter and gain can.
pub(super) fn wanted(stops: f64, mean: impl Fn(f64) -> f64) -> f64 {
    let goal = mean(stops).clamp(MEAN.0, MEAN.1);
    if goal == mean(stops) {
        return stops;
    }
    let (mut low, mut high) = (SHUTTER.0.log2(), (SHUTTER.1 * GAIN).log2());
    for _ in 0..12 {
        let middle = (low + high) / 2.0;
        if mean(middle) < goal { low = middle } else { high = middle }
    }
    (low + high) / 2.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn first_the_shutter_then_the_gain_and_both_end() {
        assert_eq!(Setting::of(0.0), Setting { shutter: 1.0, gain: 1.0 });
        assert_eq!(Setting::of(-2.0), Setting { shutter: 0.25, gain: 1.0 });
        assert_eq!(Setting::of(1.0), Setting { shutter: 2.0, gain: 1.0 });
        assert_eq!(Setting::of(3.0), Setting { shutter: 2.0, gain: 4.0 });
        assert_eq!(Setting::of(9.0), Setting { shutter: 2.0, gain: GAIN });
        assert_eq!(Setting::of(-9.0), Setting { shutter: SHUTTER.0, gain: 1.0 });
    }

    #[test]
    fn what_is_bright_enough_stays_and_the_rest_comes_to_the_nearer_end() {
        // A scene whose mean doubles with each stop.
        let scene = |at_zero: f64| move |stops: f64| at_zero * stops.exp2();
        assert_eq!(wanted(0.0, scene(80.0)), 0.0);
        assert!((wanted(0.0, scene(17.0)) - 2.0).abs() < 0.01);
        assert!((wanted(0.0, scene(204.0)) + 1.0).abs() < 0.01);
        assert!(wanted(0.0, scene(0.001)) > 5.9, "as bright as it can");
    }

    #[test]
    fn it_is_right_at_first_and_slow_afterwards() {
        let control = Control::default();
        assert_eq!(control.stops_at(1.0), None);
        let (bright, dark) = (|stops: f64| 85.0 * stops.exp2(), |stops: f64| 17.0 * stops.exp2());
        assert_eq!(control.meter(1.0, dark), wanted(0.0, dark));
        // The light goes on: the first picture is too bright, a second later most is made up for.
        let first = control.meter(1.04, bright);
        assert!((first - 2.0).abs() < 0.01, "{first}");
        let later: Vec<f64> =
            (2..30).map(|step| control.meter(1.0 + 0.04 * f64::from(step), bright)).collect();
        assert!(later.windows(2).all(|pair| pair[1] <= pair[0]));
        assert!(later[0] > 1.8 && (0.2..0.8).contains(&later[27]), "{later:?}");
        // Another stream's earlier picture changes nothing.
        let now = control.stops_at(2.16);
        control.meter(1.2, dark);
        assert_eq!(control.stops_at(2.16), now);
    }
}
