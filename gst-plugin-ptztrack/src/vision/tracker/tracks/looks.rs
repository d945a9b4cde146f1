// SPDX-License-Identifier: MPL-2.0

//! What somebody looks like: colours of the upper and the lower body, from a few sides.

use opencv::core::{Point2f, Rect2f};

use crate::vision::tracker::colour::Histogram;
use crate::vision::tracker::outline::crossings;
use crate::vision::tracker::sample::Sampler;
use crate::vision::travelling::UNKNOWN;
use crate::vision::{Luma, Observation};

/// Samples across and down a region.
const GRID: (usize, usize) = (12, 24);
/// Likelihood of foreground from which a sample counts as person.
const PERSON: u8 = UNKNOWN + 1;
/// Share of the samples of a half that must be person for its colours to be known.
const LEAST_SHARE: f32 = 0.15;
/// Time constant in which a view follows what is seen, seconds.
const LEARNING_TIME_S: f32 = 1.0;
/// Less alike than this to every view, for so long, they show another side.
const ANOTHER_SIDE: f32 = 0.6;
const TURNING_S: f32 = 0.3;
/// Sides that are kept.
const MAX_VIEWS: usize = 3;

/// Colours of the upper and the lower body in one picture, as far as they are seen.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Looks([Option<Histogram>; 2]);

#[cfg(test)]
impl Looks {
    /// Of somebody whose clothes are of these greys, each with its share.
    pub fn of_greys(greys: &[(u8, f32)]) -> Self {
        let clothes = || Histogram::of(greys.iter().map(|&(grey, share)| ((grey, Some([128, 128])), share)));
        Self([clothes(), clothes()])
    }
}

/// Takes looks from pictures; keeps its memory for the next.
#[derive(Debug, Default)]
pub(super) struct Viewer {
    sampler: Sampler,
    planes: [Vec<u8>; 4],
}

impl Viewer {
    /// What the foreground in `bounds` (pixels of the picture) looks like that lies inside of an `outline`, where one is known; nothing where
    /// nobody told the foreground.
    pub fn look(&mut self, seen: &Observation, bounds: Rect2f, outline: &[Point2f]) -> Looks {
        let Some(scene) = seen.scene else { return Looks::default() };
        let Self { sampler, planes: [foreground, luma, u, v] } = self;
        let mut sample = |plane: &Luma, out: &mut Vec<u8>| {
            sampler.sample(plane, in_plane(plane, seen, bounds), GRID, out);
        };
        sample(&scene.foreground, foreground);
        sample(&scene.luma, luma);
        let has_colour = scene.chroma.map(|[u_plane, v_plane]| {
            sample(&u_plane, u);
            sample(&v_plane, v);
        });
        if outline.len() >= 3 {
            mask(foreground, bounds, outline);
        }
        let half = GRID.0 * GRID.1 / 2;
        Looks([0..half, half..2 * half].map(|samples| {
            let person = samples.filter(|&index| foreground[index] >= PERSON);
            let colours = person.map(|index| {
                let tint = has_colour.map(|()| [u[index], v[index]]);
                ((luma[index], tint), 1.0 / half as f32)
            });
            let counted = colours.clone().count() as f32 / half as f32;
            if counted >= LEAST_SHARE { Histogram::of(colours) } else { None }
        }))
    }

    /// How much of what is in `bounds` stands out from the background, 0 to 1; `None` where that is hardly known.
    pub fn stands_out(&mut self, seen: &Observation, bounds: Rect2f) -> Option<f32> {
        let scene = seen.scene?;
        let [samples, ..] = &mut self.planes;
        self.sampler.sample(&scene.foreground, in_plane(&scene.foreground, seen, bounds), GRID, samples);
        let known = samples.iter().filter(|likelihood| **likelihood != UNKNOWN);
        let (sum, count) = known.fold((0, 0), |(sum, count), one| (sum + u32::from(*one), count + 1));
        (2 * count >= samples.len()).then(|| sum as f32 / (255.0 * count as f32))
    }
}

/// Leaves nothing of the samples of `bounds` that lie outside of an outline: they are somebody else's.
fn mask(samples: &mut [u8], bounds: Rect2f, outline: &[Point2f]) {
    let (across, down) = (bounds.width / GRID.0 as f32, bounds.height / GRID.1 as f32);
    for (row, samples) in samples.chunks_exact_mut(GRID.0).enumerate() {
        // Whether an odd number of crossings lies before the middle of a sample, and after that of the one before.
        let mut turns = [false; GRID.0 + 1];
        for crossing in crossings(outline, bounds.y + (row as f32 + 0.5) * down) {
            turns[((crossing - bounds.x) / across + 0.5).clamp(0.0, GRID.0 as f32) as usize] ^= true;
        }
        let mut is_inside = false;
        for (sample, turns) in samples.iter_mut().zip(turns) {
            is_inside ^= turns;
            *sample = if is_inside { *sample } else { 0 };
        }
    }
}

/// The part of a reduced plane that shows `bounds` of the picture.
fn in_plane(plane: &Luma, seen: &Observation, bounds: Rect2f) -> Rect2f {
    let across = plane.width() as f32 / seen.luma.width().max(1) as f32;
    let down = plane.height() as f32 / seen.luma.height().max(1) as f32;
    Rect2f::new(bounds.x * across, bounds.y * down, bounds.width * across, bounds.height * down)
}

/// One side of somebody: upper and lower body.
type View = [Histogram; 2];

/// What somebody looks like from the sides that were seen.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Views {
    /// The one that was seen last is the last.
    views: Vec<View>,
    /// For how long they have looked unlike all of them, seconds.
    unlike_s: f32,
}

impl Views {
    /// How alike they are, 0 to 1, by the side that is most alike; `None` where nothing can be told.
    pub fn likeness(&self, looks: &Looks) -> Option<f32> {
        self.views.iter().filter_map(|view| alike(view, looks)).max_by(f32::total_cmp)
    }

    /// The same of two whose sides are known.
    pub fn resemblance(&self, other: &Self) -> Option<f32> {
        let shown =
            other.views.iter().map(|[upper, lower]| Looks([Some(upper.clone()), Some(lower.clone())]));
        shown.filter_map(|looks| self.likeness(&looks)).max_by(f32::total_cmp)
    }

    /// Learns what they look like now, for certain, `dt_s` after the last time.
    pub fn learn(&mut self, looks: &Looks, dt_s: f32) {
        let of_views = self.views.iter().enumerate();
        let known = of_views.filter_map(|(index, view)| Some((index, alike(view, looks)?)));
        match known.max_by(|a, b| a.1.total_cmp(&b.1)) {
            Some((index, likeness)) if likeness >= ANOTHER_SIDE => {
                self.unlike_s = 0.0;
                let mut view = self.views.remove(index);
                for (half, new) in view.iter_mut().zip(&looks.0) {
                    if let Some(new) = new {
                        half.blend(new, dt_s / (dt_s + LEARNING_TIME_S));
                    }
                }
                self.views.push(view);
            }
            Some(_) if self.unlike_s < TURNING_S => self.unlike_s += dt_s,
            _ => self.add(looks),
        }
    }

    /// Adds a side, if all of it is seen, in place of the one that was not seen for longest.
    fn add(&mut self, looks: &Looks) {
        if let [Some(upper), Some(lower)] = &looks.0 {
            if self.views.len() == MAX_VIEWS {
                self.views.remove(0);
            }
            self.views.push([upper.clone(), lower.clone()]);
            self.unlike_s = 0.0;
        }
    }
}

/// How alike they are in the halves that are seen.
fn alike(view: &View, looks: &Looks) -> Option<f32> {
    let halves = view.iter().zip(&looks.0);
    let likeness = halves.filter_map(|(known, seen)| Some(known.likeness(seen.as_ref()?)));
    let (sum, count) = likeness.fold((0.0, 0.0_f32), |(sum, count), likeness| (sum + likeness, count + 1.0));
    (count > 0.0).then(|| sum / count)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(upper: u8, lower: u8) -> Looks {
        Looks([upper, lower].map(|grey| Histogram::of([((grey, Some([128, 128])), 1.0)].into_iter())))
    }

    #[test]
    fn what_lies_outside_of_the_outline_is_somebody_elses() {
        let left_half = [(10.0, 20.0), (16.0, 20.0), (16.0, 68.0), (10.0, 68.0)];
        let outline = left_half.map(|(x, y)| Point2f::new(x, y));
        let mut samples = vec![255; GRID.0 * GRID.1];
        mask(&mut samples, Rect2f::new(10.0, 20.0, 12.0, 48.0), &outline);
        for row in samples.chunks_exact(GRID.0) {
            assert_eq!(*row, [255, 255, 255, 255, 255, 255, 0, 0, 0, 0, 0, 0]);
        }
    }

    #[test]
    fn who_turns_round_is_known_from_both_sides() {
        let mut views = Views::default();
        views.learn(&of(40, 90), 0.04);
        for _ in 0..5 {
            views.learn(&of(200, 90), 0.04);
        }
        assert!(views.likeness(&of(200, 90)).is_some_and(|likeness| likeness < 0.6), "not at once");
        for _ in 0..5 {
            views.learn(&of(200, 90), 0.04);
        }
        for side in [of(200, 90), of(40, 90)] {
            assert!(views.likeness(&side).is_some_and(|likeness| likeness > 0.95));
        }
        assert!(views.likeness(&of(120, 20)).is_some_and(|likeness| likeness < 0.2));
    }

    #[test]
    fn sides_are_few_and_the_oldest_goes() {
        let mut views = Views::default();
        for grey in [20, 80, 140, 200] {
            for _ in 0..12 {
                views.learn(&of(grey, grey), 0.04);
            }
        }
        assert_eq!(views.views.len(), MAX_VIEWS);
        assert!(views.likeness(&of(20, 20)).is_some_and(|likeness| likeness < 0.2));
        assert!(views.likeness(&of(80, 80)).is_some_and(|likeness| likeness > 0.9));
    }

    #[test]
    fn nothing_is_told_of_what_is_not_seen() {
        let mut views = Views::default();
        assert_eq!(views.likeness(&of(40, 90)), None);
        views.learn(&Looks::default(), 0.04);
        views.learn(&of(40, 90), 0.04);
        assert_eq!(views.likeness(&Looks::default()), None);
        let upper = Looks([of(40, 90).0[0].clone(), None]);
        assert!(views.likeness(&upper).is_some_and(|likeness| likeness > 0.95), "a table hides the legs");
    }
}
