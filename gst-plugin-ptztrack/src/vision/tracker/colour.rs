// SPDX-License-Identifier: MPL-2.0

//! Colours of figure and ground: how much likelier a colour is on the target than beside it.
//!
//! Histograms of both as in Staple (Bertinetto et al., "Staple: Complementary Learners for Real-Time Tracking", CVPR
//! 2016), of the upper and the lower body each. Brightness and colour are counted apart, so that the few hundred cells of
//! one picture fill them; grey video has brightness alone.

use std::cell::OnceCell;

/// Bins of brightness, and of each of the two colour differences.
const GREYS: usize = 16;
const TINTS: usize = 13;
/// Width of a colour difference's bin: clothes and walls rarely lie further than 40 from grey.
const TINT_WIDTH: i32 = 6;
/// People's clothes are of any brightness and near grey: what the next bin of tint has of the share of this one.
const TINT_DECAY: f32 = 0.37;
/// Share that a bin has where nothing was counted.
const FLOOR: f32 = 0.005;
/// What brightness, and what tint, may say at most, as a natural logarithm of odds.
const LARGEST: f32 = 1.5;

/// One cell's colour: Y, and U and V where the picture has them.
pub(super) type Colour = (u8, Option<[u8; 2]>);

/// Shares of brightnesses and tints; each sums to 1 once something was counted.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Histogram {
    greys: [f32; GREYS],
    tints: [f32; TINTS * TINTS],
}

impl Default for Histogram {
    fn default() -> Self {
        Self { greys: [0.0; GREYS], tints: [0.0; TINTS * TINTS] }
    }
}

impl Histogram {
    /// Of weighted colours; `None` where the weights are nil.
    pub fn of(colours: impl Iterator<Item = (Colour, f32)>) -> Option<Self> {
        let mut counted = Self::default();
        let mut total = 0.0;
        for ((grey, tint), weight) in colours {
            // Half of the weight to the bin, half to its nearer neighbour by brightness: noise moves it to and fro.
            let (low, high, share) = grey_bins(grey);
            counted.greys[low] += weight * (1.0 - share);
            counted.greys[high] += weight * share;
            if let Some(tint) = tint {
                counted.tints[tint_bin(tint)] += weight;
            }
            total += weight;
        }
        (total > f32::EPSILON).then(|| counted.scaled(1.0 / total))
    }

    /// Of somebody of whom nothing is known.
    fn of_anyone() -> Self {
        let off = |bin: usize| (bin % TINTS).abs_diff(TINTS / 2) + (bin / TINTS).abs_diff(TINTS / 2);
        let tints: [f32; TINTS * TINTS] = std::array::from_fn(|bin| TINT_DECAY.powi(off(bin) as i32));
        let total: f32 = tints.iter().sum();
        Self { greys: [1.0 / GREYS as f32; GREYS], tints: tints.map(|share| share / total) }
    }

    fn scaled(mut self, factor: f32) -> Self {
        self.greys.iter_mut().chain(&mut self.tints).for_each(|share| *share *= factor);
        self
    }

    /// The Bhattacharyya coefficients of brightness and tint, multiplied: 0 to 1.
    pub fn likeness(&self, other: &Self) -> f32 {
        let coefficient = |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(a, b)| (a * b).sqrt()).sum::<f32>();
        let tints =
            if self.has_tints() && other.has_tints() { coefficient(&self.tints, &other.tints) } else { 1.0 };
        coefficient(&self.greys, &other.greys) * tints
    }

    /// Moves to `other` by `rate`, 0 to 1; a grey picture says nothing of tints.
    pub fn blend(&mut self, other: &Self, rate: f32) {
        let mix = |old: &mut f32, new: &f32| *old += (*new - *old) * rate;
        self.greys.iter_mut().zip(&other.greys).for_each(|(old, new)| mix(old, new));
        if other.has_tints() {
            self.tints.iter_mut().zip(&other.tints).for_each(|(old, new)| mix(old, new));
        }
    }

    fn has_tints(&self) -> bool {
        self.tints.iter().any(|share| *share > 0.0)
    }
}

/// The two bins that a brightness lies between, and the share of the second.
fn grey_bins(grey: u8) -> (usize, usize, f32) {
    let place = (f32::from(grey) / 256.0 * GREYS as f32 - 0.5).max(0.0);
    let low = place as usize;
    (low, (low + 1).min(GREYS - 1), place - low as f32)
}

fn tint_bin([u, v]: [u8; 2]) -> usize {
    usize::from(TINT_BINS[usize::from(u)]) * TINTS + usize::from(TINT_BINS[usize::from(v)])
}

/// The bin of each colour difference: it is asked for more often than anything else.
const TINT_BINS: [u8; 256] = {
    let (mut bins, mut tint) = ([0; 256], 0);
    while tint < bins.len() {
        let place = (tint as i32 - 128 + TINT_WIDTH / 2).div_euclid(TINT_WIDTH) + TINTS as i32 / 2;
        let last = TINTS as i32 - 1;
        bins[tint] = if place < 0 {
            0
        } else if place > last {
            last as u8
        } else {
            place as u8
        };
        tint += 1;
    }
    bins
};

/// Upper and lower body against what is beside them, and against other people.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct ColourModel {
    /// Upper body, lower body.
    figure: [Histogram; 2],
    ground: Alternative,
    anyone: Alternative,
}

impl ColourModel {
    pub fn new(figure: [Histogram; 2], ground: Histogram) -> Self {
        Self { figure, ground: ground.into(), anyone: Histogram::of_anyone().into() }
    }

    /// Logarithm of the odds that a cell of a colour belongs to the target and not to the ground; `lower` 0 (upper body) to 1 (lower), as
    /// all cells of a row have it.
    pub fn log_odds(&self, lower: f32) -> impl Fn(Colour) -> f32 {
        self.ground.log_odds(&self.figure, lower)
    }

    /// The same against somebody of whom nothing is known.
    pub fn log_odds_against_anyone(&self, lower: f32) -> impl Fn(Colour) -> f32 {
        self.anyone.log_odds(&self.figure, lower)
    }

    /// Learns what is figure (upper and lower body) and ground now, at that rate from 0 to 1; what was not seen stays as it is.
    pub fn learn(&mut self, figure: [Option<Histogram>; 2], ground: Option<Histogram>, rate: f32) {
        let [upper, lower] = &mut self.figure;
        let known = [upper, lower, &mut self.ground.colours];
        for (old, new) in known.into_iter().zip(figure.iter().chain([&ground])) {
            if let Some(new) = new {
                old.blend(new, rate);
            }
        }
        self.ground.odds.take();
        self.anyone.odds.take();
    }
}

/// What else a cell may belong to.
#[derive(Debug, Clone, PartialEq)]
struct Alternative {
    colours: Histogram,
    /// Logarithms of odds of either half of the figure against it, worked out once, and only where they are asked for.
    odds: OnceCell<[Odds; 2]>,
}

/// Logarithms of the odds of each brightness and each tint.
#[derive(Debug, Clone, PartialEq)]
struct Odds {
    greys: [f32; 256],
    tints: [f32; TINTS * TINTS],
}

impl From<Histogram> for Alternative {
    fn from(colours: Histogram) -> Self {
        Self { colours, odds: OnceCell::new() }
    }
}

impl Alternative {
    fn log_odds(&self, figure: &[Histogram; 2], lower: f32) -> impl Fn(Colour) -> f32 {
        // Near the middle of the body both halves count; everywhere else there is a table.
        let halves =
            (lower == 0.0 || lower == 1.0).then(|| self.odds.get_or_init(|| odds(figure, &self.colours)));
        let table = halves.map(|[upper, below]| if lower == 0.0 { upper } else { below });
        move |(grey, tint)| {
            let tint = tint.map(tint_bin);
            match table {
                Some(odds) => odds.greys[usize::from(grey)] + tint.map_or(0.0, |bin| odds.tints[bin]),
                None => {
                    let tinted = tint.map_or(0.0, |bin| tint_odds(figure, &self.colours, bin, lower));
                    grey_odds(figure, &self.colours, grey, lower) + tinted
                }
            }
        }
    }
}

fn odds(figure: &[Histogram; 2], other: &Histogram) -> [Odds; 2] {
    [0.0, 1.0].map(|lower| Odds {
        greys: std::array::from_fn(|grey| grey_odds(figure, other, grey as u8, lower)),
        tints: std::array::from_fn(|bin| tint_odds(figure, other, bin, lower)),
    })
}

fn grey_odds(figure: &[Histogram; 2], other: &Histogram, grey: u8, lower: f32) -> f32 {
    let (low, high, share) = grey_bins(grey);
    let brightness = |h: &Histogram| h.greys[low] * (1.0 - share) + h.greys[high] * share;
    log_odds(either(figure, lower, brightness), brightness(other))
}

fn tint_odds(figure: &[Histogram; 2], other: &Histogram, bin: usize, lower: f32) -> f32 {
    log_odds(either(figure, lower, |h| h.tints[bin]), other.tints[bin])
}

/// Of the upper and the lower body as `lower` says.
fn either(figure: &[Histogram; 2], lower: f32, of: impl Fn(&Histogram) -> f32) -> f32 {
    of(&figure[0]) * (1.0 - lower) + of(&figure[1]) * lower
}

fn log_odds(figure: f32, other: f32) -> f32 {
    ((figure + FLOOR) / (other + FLOOR)).ln().clamp(-LARGEST, LARGEST)
}

#[cfg(test)]
mod tests {
    use super::*;

    const RED: Colour = (90, Some([110, 190]));
    const DARK: Colour = (40, Some([128, 128]));
    const WALL: Colour = (150, Some([126, 130]));

    fn of(colour: Colour) -> Histogram {
        Histogram::of([(colour, 1.0)].into_iter()).expect("counted")
    }

    fn model() -> ColourModel {
        ColourModel::new([of(RED), of(DARK)], of(WALL))
    }

    #[test]
    fn each_half_knows_its_own_colour() {
        let model = model();
        assert!(model.log_odds(0.0)(RED) > 2.0 && model.log_odds(1.0)(DARK) > 1.0);
        assert!(model.log_odds(0.0)(WALL) < -1.0 && model.log_odds(1.0)(WALL) < -1.0);
        assert!(model.log_odds(1.0)(RED) < model.log_odds(0.0)(RED));
    }

    #[test]
    fn colours_that_it_does_not_wear_are_somebody_elses() {
        let odds = |colour, lower| model().log_odds_against_anyone(lower)(colour);
        assert!(odds(RED, 0.0) > 2.0 && odds(DARK, 1.0) > 1.0);
        assert!(odds(RED, 1.0) < -0.5 && odds(DARK, 0.0) < -2.0 && odds(WALL, 0.0) < -2.0);
        let anyone = Histogram::of_anyone();
        let sum = |shares: &[f32]| shares.iter().sum::<f32>();
        assert!((sum(&anyone.greys) - 1.0).abs() < 1e-4 && (sum(&anyone.tints) - 1.0).abs() < 1e-4);
    }

    #[test]
    fn nothing_counted_is_no_histogram() {
        assert_eq!(Histogram::of([(RED, 0.0)].into_iter()), None);
    }

    #[test]
    fn grey_video_is_told_apart_by_brightness() {
        let grey = |level| (level, None);
        let model = ColourModel::new([of(grey(60)), of(grey(60))], of(grey(160)));
        assert!(model.log_odds(0.5)(grey(60)) > 1.0 && model.log_odds(0.5)(grey(160)) < -1.0);
    }

    #[test]
    fn a_grey_picture_leaves_the_tints_as_they_were() {
        let mut model = model();
        for _ in 0..30 {
            model.learn([Some(of((90, None))), None], Some(of((150, None))), 0.2);
        }
        assert!(model.log_odds(0.0)(RED) > 2.0 && model.log_odds(0.0)(WALL) < -1.0);
        assert!(model.log_odds(0.0)((90, None)) > 1.0, "brightness still counts");
    }

    #[test]
    fn what_is_learned_takes_over_and_what_is_hidden_stays() {
        let mut model = model();
        for _ in 0..30 {
            model.learn([Some(of(WALL)), None], Some(of(RED)), 0.2);
        }
        assert!(model.log_odds(0.0)(WALL) > 1.0 && model.log_odds(0.0)(RED) < -1.0);
        assert!(model.log_odds(1.0)(DARK) > 1.0, "the lower half was not seen");
    }
}
