// SPDX-License-Identifier: MPL-2.0

use std::collections::VecDeque;
use std::time::Duration;

use ptztrack_contract::Rect;

use crate::Time;
use crate::estimation::{Measurement, Samples, Visibility};

/// Keeps the target as tall in the picture as is wished, and widens the view when it is not seen well.
///
/// Everything is in logarithms of the magnification: a zoom is as fast whether far or near.
#[derive(Debug, Default)]
pub struct ZoomController {
    /// Logarithm of the target's height in a picture that nothing magnifies, over time.
    sizes: VecDeque<(Time, f64)>,
    id: u64,
    zooming: bool,
    view: Outlook,
    /// Since when it is much shorter than it was.
    shrunk_at: Option<Time>,
}

/// What the last picture allows.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
enum Outlook {
    /// Either way.
    #[default]
    Clear,
    /// The target is far from the middle, or what is seen may be a part of it: no nearer.
    NoNearer,
    /// It is hidden, or cut off by the picture's edge: wider.
    Uncertain,
}

impl ZoomController {
    /// Heights are averaged, and their change found, over this time: steps and gestures last less.
    const WINDOW: Duration = Duration::from_millis(800);

    /// Part of the error that is made good in a second: half of what pan and tilt do by default.
    const GAIN: f64 = 1.0;

    /// A longer pause between two pictures counts as one of this length: there is never more than one in the window, and
    /// it never fills it.
    const PAUSE: Duration = Duration::from_millis(500);

    /// Logarithm of the magnification per second, at most ...
    const FASTEST: f64 = 0.6;

    /// ... and that with which the view is widened when the target is not seen well.
    pub(super) const WIDENING: f64 = 0.4;

    /// A height this much off, as a logarithm, is tolerated while the zoom rests ...
    const START: f64 = 0.09;

    /// ... and while it moves.
    const REST: f64 = 0.03;

    /// From a target that is growing or shrinking less than this, per second, the zoom may rest.
    const STEADY: f64 = 0.03;

    /// A target farther than this from the middle, in picture widths or heights, is not zoomed in on.
    const OFF_CENTRE: f64 = 0.25;

    /// Nobody who walks away becomes shorter by so much, as a logarithm, from one picture to the next: what is seen is a part of
    /// them ...
    const PART: f64 = 0.3;

    /// ... unless that lasts.
    const PART_FOR: Duration = Duration::from_secs(5);

    /// Takes a picture; `magnification`: of the picture against the zoomed-out one.
    pub fn see(&mut self, measurement: &Measurement, magnification: f64) {
        if measurement.id != self.id {
            self.forget();
            self.id = measurement.id;
        }
        self.view = outlook(measurement);
        let size = (measurement.bounds.height / magnification).ln();
        if self.view == Outlook::Uncertain || !size.is_finite() {
            return;
        }
        let taken_at = measurement.taken_at;
        if self.sizes.back().is_some_and(|(last, _)| *last >= taken_at) {
            self.sizes.clear();
        }
        if self.is_part(size, taken_at) {
            self.view = Outlook::NoNearer;
            return;
        }
        self.sizes.push_back((taken_at, size));
        while self.seen_for() > Self::WINDOW {
            self.sizes.pop_front();
        }
    }

    /// Whether this is the size of a part of the target; what stays so for long is the target.
    fn is_part(&mut self, size: f64, taken_at: Time) -> bool {
        if self.size(Duration::ZERO).is_none_or(|whole| size > whole.expected - Self::PART) {
            self.shrunk_at = None;
            return false;
        }
        let lasts = taken_at - *self.shrunk_at.get_or_insert(taken_at);
        if lasts >= Self::PART_FOR {
            self.shrunk_at = None;
            self.sizes.clear();
            return false;
        }
        true
    }

    /// How long the heights were watched, of each pause between two pictures a little only: during a move from rest to
    /// rest there are none.
    fn seen_for(&self) -> Duration {
        let pairs = self.sizes.iter().zip(self.sizes.iter().skip(1));
        pairs.map(|((before, _), (after, _))| (*after - *before).min(Self::PAUSE)).sum()
    }

    /// A magnification of this logarithm is none from now on.
    pub fn count_from(&mut self, logarithm: f64) {
        for (_, size) in &mut self.sizes {
            *size += logarithm;
        }
    }

    /// Forgets the target.
    pub fn forget(&mut self) {
        self.sizes.clear();
        self.zooming = false;
        self.view = Outlook::Clear;
        self.shrunk_at = None;
    }

    /// The wanted change of the magnification's logarithm per second, for a command that acts `lead` after the
    /// last picture, when the magnification will be this one.
    pub fn rate(&mut self, target_height: f64, magnification: f64, lead: Duration) -> f64 {
        if self.view == Outlook::Uncertain {
            self.zooming = true;
            return -Self::WIDENING;
        }
        let Some(size) = self.size(lead) else { return 0.0 };
        let wanted = target_height.ln() - magnification.ln();
        let (error, growth) = (wanted - size.expected, size.growth);
        self.zooming = if self.zooming {
            error.abs() > Self::REST || growth.abs() > Self::STEADY
        } else {
            // Nothing that is foreseen only: a gesture looks like growth.
            (wanted - size.seen).abs() > Self::START
        };
        if !self.zooming {
            return 0.0;
        }
        let rate = (Self::GAIN * error - growth).clamp(-Self::FASTEST, Self::FASTEST);
        if self.view == Outlook::NoNearer { rate.min(0.0) } else { rate }
    }

    /// By what factor to magnify at once, for a zoom from rest to rest that is to be right `lead` after the last
    /// picture, and whether that is worth a move of its own; `None`: it is well as it is.
    pub fn factor(&self, target_height: f64, magnification: f64, lead: Duration) -> Option<(f64, bool)> {
        let error = match self.view {
            Outlook::Uncertain => -Self::WIDENING,
            _ => target_height.ln() - magnification.ln() - self.size(lead)?.expected,
        };
        let allowed = if self.view == Outlook::NoNearer { error.min(0.0) } else { error };
        let factor = allowed.clamp(-Self::FASTEST, Self::FASTEST).exp();
        (allowed.abs() > Self::REST).then_some((factor, allowed.abs() > Self::START))
    }

    /// What holds at any time.
    pub fn check_invariants(&self) {
        assert!(self.seen_for() <= Self::WINDOW, "heights of {:?}", self.seen_for());
        assert!(self.sizes.iter().all(|(_, size)| size.is_finite()), "a height that is no number");
        assert!(self.sizes.iter().is_sorted_by_key(|(at, _)| *at), "heights out of order");
    }

    fn size(&self, lead: Duration) -> Option<Size> {
        let (newest, _) = self.sizes.back()?;
        let sizes = Samples::new(self.sizes.iter().map(|(at, size)| (-(*newest - *at).as_secs_f64(), *size)));
        let growth = sizes.slope();
        Some(Size { seen: sizes.mean(), expected: sizes.line(growth, lead.as_secs_f64()), growth })
    }
}

/// Logarithm of the target's height in a picture that nothing magnifies.
struct Size {
    /// Its mean over the window.
    seen: f64,
    /// After the lead.
    expected: f64,
    /// Per second.
    growth: f64,
}

fn outlook(measurement: &Measurement) -> Outlook {
    let Rect { x, y, width, height } = measurement.bounds;
    let inside = Measurement::EDGE..=1.0 - Measurement::EDGE;
    let whole = [x, y, x + width, y + height].iter().all(|edge| inside.contains(edge));
    let middle = measurement.bounds.centre();
    let off = (middle.x - 0.5).abs().max((middle.y - 0.5).abs());
    match measurement.visibility {
        Visibility::Seen if whole && off <= ZoomController::OFF_CENTRE => Outlook::Clear,
        Visibility::Seen if whole => Outlook::NoNearer,
        _ => Outlook::Uncertain,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn target(height: f64, milliseconds: u64) -> Measurement {
        let bounds = Rect { x: 0.45, y: 0.5 - height / 2.0, width: 0.1, height };
        Measurement { bounds, ..Measurement::at(0.5, 0.5, Time::from_millis(milliseconds)) }
    }

    /// One that has seen a target for a second, at no magnification.
    fn seen(height: impl Fn(f64) -> f64) -> ZoomController {
        let mut zoom = ZoomController::default();
        for picture in 0..=25 {
            zoom.see(&target(height(f64::from(picture as u32) / 25.0), 40 * picture), 1.0);
        }
        zoom
    }

    #[test]
    fn a_small_target_is_zoomed_in_on_and_a_tall_one_out_of() {
        let lead = Duration::from_millis(200);
        assert!((seen(|_| 0.2).rate(0.3, 1.0, lead) - 1.5f64.ln()).abs() < 0.01);
        assert!((seen(|_| 0.4).rate(0.3, 1.0, lead) - 0.75f64.ln()).abs() < 0.01);
        assert_eq!(seen(|_| 0.3).rate(0.3, 1.0, lead), 0.0);
        assert_eq!(seen(|_| 0.15).rate(0.3, 2.0, lead), 0.0, "magnified already");
        assert_eq!(ZoomController::default().rate(0.3, 1.0, lead), 0.0);
    }

    #[test]
    fn a_height_that_trembles_moves_nothing() {
        let mut zoom = ZoomController::default();
        for picture in 0..500u64 {
            zoom.see(&target(0.3 + 0.02 * ((picture * 7919 % 100) as f64 / 50.0 - 1.0), 40 * picture), 1.0);
            assert_eq!(zoom.rate(0.3, 1.0, Duration::from_millis(300)), 0.0);
        }
    }

    #[test]
    fn a_target_that_walks_away_is_zoomed_after() {
        let rate = seen(|time| 0.3 * (-0.3 * time).exp()).rate(0.3, 1.0, Duration::ZERO);
        assert!((rate - (0.3 + 0.3)).abs() < 0.01, "{rate}");
    }

    #[test]
    fn what_is_not_seen_well_widens_the_view() {
        let lead = Duration::ZERO;
        let mut zoom = seen(|_| 0.2);
        zoom.see(&Measurement { visibility: Visibility::Predicted, ..target(0.2, 2000) }, 1.0);
        assert!(zoom.rate(0.3, 1.0, lead) < 0.0);
        assert!(zoom.factor(0.3, 1.0, lead).unwrap().0 < 1.0);
        let cut = Rect { x: 0.45, y: 0.0, width: 0.1, height: 0.2 };
        zoom.see(&Measurement { bounds: cut, ..target(0.2, 2040) }, 1.0);
        assert!(zoom.rate(0.3, 1.0, lead) < 0.0);
        let aside = Rect { x: 0.85, y: 0.4, width: 0.1, height: 0.2 };
        zoom.see(&Measurement { bounds: aside, ..target(0.2, 2080) }, 1.0);
        assert_eq!(zoom.rate(0.3, 1.0, lead), 0.0);
        assert_eq!(zoom.factor(0.3, 1.0, lead), None);
        zoom.see(&target(0.2, 2120), 1.0);
        assert!(zoom.rate(0.3, 1.0, lead) > 0.0);
        assert!((zoom.factor(0.3, 1.0, lead).unwrap().0 - 1.5).abs() < 0.05);
    }

    /// A tracker that holds their legs only says that somebody is a quarter as tall: the camera would zoom until these fill the
    /// picture.
    #[test]
    fn what_is_suddenly_much_shorter_is_a_part_of_the_target_unless_that_lasts() {
        let rate_after = |heights: &[(f64, u64)]| {
            let (mut zoom, mut now) = (seen(|_| 0.4), 1000);
            for (height, pictures) in heights {
                for _ in 0..*pictures {
                    now += 40;
                    zoom.see(&target(*height, now), 1.0);
                    zoom.check_invariants();
                }
            }
            zoom.rate(0.4, 1.0, Duration::ZERO)
        };
        assert_eq!(rate_after(&[(0.1, 1)]), 0.0);
        assert_eq!(rate_after(&[(0.1, 120)]), 0.0);
        assert_eq!(rate_after(&[(0.1, 120), (0.4, 1), (0.1, 120)]), 0.0, "it was seen whole in between");
        assert!(rate_after(&[(0.1, 130)]) > 0.0);
        assert!(rate_after(&[(0.1, 1), (0.6, 25)]) < 0.0, "nearer than before");
    }

    #[test]
    fn growth_is_seen_across_a_pause() {
        let mut zoom = ZoomController::default();
        let trembling = |at: u64| 0.005 * ((at * 7919 % 100) as f64 / 50.0 - 1.0);
        for at in (0..400).step_by(40).chain((1200..1300).step_by(40)) {
            let height = 0.3 * (-0.3 * at as f64 / 1000.0 + trembling(at)).exp();
            zoom.see(&target(height, at), 1.0);
        }
        let size = zoom.size(Duration::from_millis(500)).unwrap();
        assert!((size.growth + 0.3).abs() < 0.02, "{}", size.growth);
        assert!((size.expected - (0.3f64.ln() - 0.3 * 1.78)).abs() < 0.02, "{}", size.expected);
    }

    proptest! {
        #[test]
        fn the_rate_is_bounded(heights in prop::collection::vec(0.0..1.0f64, 1..40), wanted in 0.05..0.95f64) {
            let mut zoom = ZoomController::default();
            for (picture, height) in (0..).zip(heights) {
                zoom.see(&target(height, 40 * picture), 1.0 + height * 10.0);
                let rate = zoom.rate(wanted, 1.0 + height * 10.0, Duration::from_millis(300));
                prop_assert!(rate.abs() <= ZoomController::FASTEST, "{rate}");
            }
        }
    }
}
