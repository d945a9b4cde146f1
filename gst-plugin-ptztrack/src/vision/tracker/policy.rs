// SPDX-License-Identifier: MPL-2.0

//! Which track is the target.

use std::sync::Arc;

use opencv::core::{Point2f, Rect2f};

use super::ego_motion::EgoMotion;
use super::geometry::{Frame, breadth, centre, grown, length, overlap};
use super::tracks::{Track, Tracks};

/// A track at the edge may be half a person: how long it may take to walk in, seconds.
const EDGE_WAIT_S: f64 = 1.2;
/// How long what was released is not taken again, seconds.
const RELEASE_HOLD_S: f64 = 3.0;
/// What lies by more than this where much changed for nothing may be a part of that, as somebody in a film, however far it
/// goes: it has to leave.
const RESTLESS: f32 = 0.5;
/// Most places at which somebody stood that are remembered: the oldest goes.
const MAX_PARKED: usize = 16;
/// Who is so many times as tall as when they stood has come nearer.
const NEARER: f32 = 1.3;
/// How far beside somebody a click may be, pixels.
const CLICK_REACH: f32 = 12.0;

/// How the target is chosen among the tracks.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Choice {
    /// The one of largest area.
    #[default]
    Largest,
    /// The one that was there first.
    First,
    /// The one nearest to the middle of the frame.
    NearestCentre,
    /// All of them: the one of largest area, and everybody else in the same box.
    Group,
    /// None: an operator chooses.
    Manual,
}

/// Chooses the target.
#[derive(Debug, Default)]
pub(super) struct Policy {
    /// Who stood, and where, in the newest picture: the place goes with the background.
    parked: Vec<(u64, Rect2f)>,
    released: Option<(u64, f64)>,
    /// Who is chosen by nobody but an operator.
    ignored: Arc<[u64]>,
}

impl Policy {
    /// Forgets everything but who is to be ignored: another stream begins.
    pub fn restart(&mut self) {
        *self = Self { ignored: std::mem::take(&mut self.ignored), ..Self::default() };
    }

    /// The tracks of these numbers are not chosen, from now on.
    pub fn ignore(&mut self, ids: Arc<[u64]>) {
        self.ignored = ids;
    }

    /// The track of that number is followed from now on.
    pub fn take(&mut self, id: u64) {
        self.parked.retain(|(parked, _)| *parked != id);
    }

    /// That track was let go because it stands: nobody is chosen there until it moves.
    pub fn park(&mut self, id: u64, bounds: Rect2f) {
        if self.parked.len() == MAX_PARKED {
            self.parked.remove(0);
        }
        self.parked.push((id, bounds));
    }

    /// That track was let go on purpose: it is not chosen again for a while.
    pub fn release(&mut self, id: u64) {
        self.released = Some((id, RELEASE_HOLD_S));
    }

    /// So much time passes, in which the background moves as `ego`. Where nobody knows how it moves, nobody knows any more where
    /// somebody stood.
    pub fn pass(&mut self, tracks: &Tracks, ego: Option<EgoMotion>, dt_s: f64) {
        self.parked.retain_mut(|(id, place)| {
            let Some(ego) = ego else { return false };
            *place = ego.apply_to(*place);
            tracks.get(*id).is_none_or(|track| stands_at(*place, track.seen_bounds()))
        });
        self.released = self.released.filter(|(_, left)| *left > dt_s).map(|(id, left)| (id, left - dt_s));
    }

    /// The tracks that may be followed now: seen, and going somewhere where they `must_travel`.
    pub fn ready<'a>(
        &'a self,
        tracks: &'a Tracks,
        must_travel: bool,
        frame: Frame,
    ) -> impl Iterator<Item = &'a Track> {
        tracks.seen().filter(move |track| {
            let bounds = track.seen_bounds();
            let region = tracks.region(track);
            track.is_confirmed()
                && region
                    .is_some_and(|region| !region.outside && (!must_travel || region.restless <= RESTLESS))
                && (track.journey.age_s >= EDGE_WAIT_S || !is_entering(tracks, bounds, frame))
                && self.released.is_none_or(|(released, _)| released != track.id)
                && !self.ignored.contains(&track.id)
                && !self.is_parked(track)
                && (!must_travel || track.travels())
        })
    }

    /// Whether a track is where somebody stood that was let go.
    pub fn is_parked(&self, track: &Track) -> bool {
        self.parked.iter().any(|(_, place)| stands_at(*place, track.seen_bounds()))
    }

    /// The track to follow now, one that is seen, and going somewhere where it `must_travel`: the one of the number `before` all
    /// others.
    pub fn choose<'a>(
        &'a self,
        tracks: &'a Tracks,
        choice: Choice,
        before: Option<u64>,
        must_travel: bool,
        frame: Frame,
    ) -> Option<&'a Track> {
        let ready = || self.ready(tracks, must_travel, frame);
        let by = |value: fn(&Track, Frame) -> f64| {
            let best = move |track: &&Track| value(track, frame);
            ready().max_by(|a, b| best(a).total_cmp(&best(b)))
        };
        if choice == Choice::Manual {
            return None;
        }
        let known = ready().find(|track| Some(track.id) == before);
        known.or_else(|| match choice {
            Choice::Largest | Choice::Group => by(|track, _| f64::from(track.seen_bounds().area())),
            Choice::First => by(|track, _| -(track.id as f64)),
            Choice::NearestCentre => {
                by(|track, frame| -f64::from(length(centre(track.seen_bounds()) - centre(frame.bounds()))))
            }
            Choice::Manual => None,
        })
    }
}

/// Whether who is seen in `bounds` has not moved from a place, sideways by a width or nearer: an arm or a leg is there as well.
fn stands_at(place: Rect2f, bounds: Rect2f) -> bool {
    let offset = centre(bounds) - centre(place);
    let sideways = breadth(place);
    offset.x.abs() < sideways
        && offset.y.abs() < sideways.max(place.height / 2.0)
        && bounds.height < NEARER * place.height
}

/// Whether somebody is still coming into view, or leaving: a leg goes before the body. Of whoever is cut off by the lower edge only, head
/// and trunk are there, which may be all that is ever seen of them: somebody near walks past below.
fn is_entering(tracks: &Tracks, bounds: Rect2f, frame: Frame) -> bool {
    let parts = tracks.seen().map(Track::seen_bounds).filter(|part| may_be_one(bounds, *part));
    parts.into_iter().any(|part| {
        let [left, top, right, _] = frame.cut_sides(part);
        left || top || right
    })
}

/// The smallest of the tracks seen in this picture that a click at `point` means, a little beside it too.
pub(super) fn clicked(tracks: &Tracks, point: Point2f) -> Option<&Track> {
    tracks
        .seen()
        .filter(|track| grown(track.seen_bounds(), CLICK_REACH).contains(point))
        .min_by(|a, b| a.seen_bounds().area().total_cmp(&b.seen_bounds().area()))
}

/// The target is seen at `bounds`: who is seen beside it is somebody else, wherever they go from then on. What is above or below
/// may be a part of it.
pub(super) fn tell_apart(tracks: &mut Tracks, target: u64, bounds: Rect2f, dt_s: f64) {
    for track in tracks.seen_mut().filter(|track| track.id != target) {
        let seen = track.seen_bounds();
        if overlap(bounds, seen) <= 0.0 && !may_be_one(bounds, seen) {
            track.beside_target_s += dt_s;
        }
    }
}

/// Whether two boxes stand one above the other, so near that they may be parts of one body: where clothes look like the wall
/// behind them, legs and trunk are seen apart.
fn may_be_one(a: Rect2f, b: Rect2f) -> bool {
    let across = a.br().x.min(b.br().x) - a.x.max(b.x);
    let between = a.y.max(b.y) - a.br().y.min(b.br().y);
    across > 0.5 * a.width.min(b.width) && between < a.height.max(b.height)
}

#[cfg(test)]
mod tests {
    use super::super::tracks::seen_in;
    use super::*;

    const FRAME: Frame = Frame { width: 640.0, height: 480.0 };
    const DT: f64 = 0.1;
    const STILL: Option<EgoMotion> = None;

    fn at(x: f32, y: f32, width: f32, height: f32) -> Rect2f {
        Rect2f::new(x, y, width, height)
    }

    /// Tracks that are confirmed in three pictures, and the policy beside them.
    #[derive(Default)]
    struct Chain {
        tracks: Tracks,
        policy: Policy,
    }

    impl Chain {
        fn see(&mut self, regions: &[Rect2f], ego: Option<EgoMotion>) {
            seen_in(&mut self.tracks, regions, ego, DT);
            self.policy.pass(&self.tracks, ego, DT);
        }

        fn choose(&self, choice: Choice, must_travel: bool) -> Option<&Track> {
            self.policy.choose(&self.tracks, choice, None, must_travel, FRAME)
        }

        fn chosen(&self) -> Option<Rect2f> {
            self.choose(Choice::Largest, false).map(Track::seen_bounds)
        }
    }

    fn seen(frames: usize, regions: &[Rect2f]) -> Chain {
        let mut chain = Chain::default();
        (0..frames).for_each(|_| chain.see(regions, STILL));
        chain
    }

    #[test]
    fn choices() {
        let mut chain = seen(2, &[at(300.0, 200.0, 20.0, 50.0)]);
        for _ in 0..3 {
            let all =
                [at(300.0, 200.0, 20.0, 50.0), at(30.0, 30.0, 60.0, 120.0), at(400.0, 220.0, 30.0, 60.0)];
            chain.see(&all, STILL);
        }
        let x = |choice| chain.choose(choice, false).map(|track| track.seen_bounds().x);
        assert_eq!(x(Choice::Largest), Some(30.0));
        assert_eq!(x(Choice::First), Some(300.0));
        assert_eq!(x(Choice::NearestCentre), Some(300.0));
        assert_eq!(x(Choice::Manual), None);
        let known = chain.choose(Choice::First, false).map(|track| track.id);
        let again = chain.policy.choose(&chain.tracks, Choice::Largest, known, false, FRAME);
        assert_eq!(
            again.map(|track| track.seen_bounds().x),
            Some(300.0),
            "who was lost goes before all others"
        );
    }

    #[test]
    fn a_flicker_is_not_chosen() {
        assert_eq!(seen(2, &[at(100.0, 100.0, 40.0, 90.0)]).chosen(), None);
        let mut chain = Chain::default();
        for n in 0..9 {
            chain.see(&[at(60.0 * n as f32, 100.0, 20.0, 30.0)], STILL);
        }
        assert_eq!(chain.chosen(), None);
    }

    #[test]
    fn half_a_person_at_the_edge_is_awaited_but_not_for_ever() {
        let edge = [at(0.0, 100.0, 30.0, 90.0)];
        assert_eq!(seen(5, &edge).chosen(), None);
        assert_eq!(seen(16, &edge).chosen(), Some(edge[0]));
    }

    /// Whether what looks like `path` at each frame is chosen within two seconds, where it must travel.
    fn travels(ego: EgoMotion, path: impl Fn(f32) -> Rect2f) -> bool {
        let mut chain = Chain::default();
        (0..20).any(|n| {
            chain.see(&[path(n as f32)], Some(ego));
            chain.choose(Choice::Largest, true).is_some()
        })
    }

    #[test]
    fn whoever_walks_past_below_is_chosen_at_once() {
        let head = [at(100.0, 400.0, 70.0, 80.0)];
        assert_eq!(seen(5, &head).chosen(), Some(head[0]));
    }

    #[test]
    fn a_walker_travels_whatever_the_camera_does() {
        for pan in [0.0, -4.0, 7.0] {
            let ego = EgoMotion::translation(Point2f::new(pan, 0.0));
            assert!(travels(ego, |n| at(300.0 + (4.0 + pan) * n, 100.0, 40.0, 90.0)), "{pan}");
        }
        let nearer = |n| at(300.0 - 0.5 * n, 100.0, 40.0 + n, 90.0 + 2.0 * n);
        assert!(travels(EgoMotion::default(), nearer));
    }

    #[test]
    fn what_changes_but_stays_does_not_travel() {
        let still = EgoMotion::default();
        assert!(!travels(still, |_| at(300.0, 100.0, 60.0, 40.0)), "a screen");
        assert!(!travels(still, |n| at(300.0, 100.0, 40.0 + 4.0 * n, 200.0)), "a door");
        assert!(!travels(still, |n| at(300.0 + 5.0 * (n % 2.0), 100.0, 60.0, 200.0)), "a curtain");
        let pan = EgoMotion::translation(Point2f::new(6.0, 0.0));
        assert!(!travels(pan, |n| at(200.0 + 6.0 * n, 100.0, 60.0, 40.0)), "a screen, the camera turning");
    }

    /// Somebody in a film goes from one side of the screen to the other.
    #[test]
    fn who_is_where_much_changed_for_nothing_must_come_out_of_there() {
        let film = |chain: &mut Chain, n: usize| {
            let x = 200.0 + 10.0 * (n % 8) as f32;
            chain.see(&[at(x, 100.0, 30.0, 40.0)], Some(EgoMotion::default()));
            chain.choose(Choice::Largest, true).is_some()
        };
        let mut chain = Chain::default();
        for _ in 0..30 {
            chain.see(&[at(190.0, 90.0, 130.0, 60.0)], Some(EgoMotion::default()));
        }
        for _ in 0..40 {
            chain.see(&[], Some(EgoMotion::default()));
        }
        assert!(!(0..8).any(|n| film(&mut chain, n)));
        let mut elsewhere = Chain::default();
        assert!((0..8).any(|n| film(&mut elsewhere, n)));
    }

    #[test]
    fn what_was_released_is_held_back() {
        let one = [at(300.0, 200.0, 30.0, 60.0)];
        let mut chain = seen(4, &one);
        let id = chain.choose(Choice::Largest, false).expect("confirmed").id;
        chain.policy.release(id);
        chain.see(&one, STILL);
        assert_eq!(chain.chosen(), None);
        for _ in 0..40 {
            chain.see(&one, STILL);
        }
        assert_eq!(chain.chosen(), Some(one[0]));
    }

    #[test]
    fn who_is_ignored_is_not_chosen_and_somebody_else_is() {
        let both = [at(300.0, 200.0, 60.0, 120.0), at(100.0, 200.0, 30.0, 60.0)];
        let mut chain = seen(4, &both);
        let id = chain.choose(Choice::Largest, false).expect("confirmed").id;
        chain.policy.ignore([id].into());
        assert_eq!(chain.chosen(), Some(both[1]));
        chain.policy.restart();
        assert_eq!(chain.chosen(), Some(both[1]), "for as long as they are to be ignored");
        chain.policy.ignore([].into());
        assert_eq!(chain.chosen(), Some(both[0]));
    }

    #[test]
    fn who_stood_is_not_chosen_until_they_move_or_come_nearer() {
        let moved = |x: f32, growth: f32| at(300.0 + x, 200.0, 40.0 * growth, 90.0 * growth);
        for (bounds, chosen) in [
            (moved(-30.0, 1.0), false),
            (moved(45.0, 1.0), true),
            (moved(0.0, 1.4), true),
            (at(285.0, 205.0, 30.0, 15.0), false),
        ] {
            let still = Some(EgoMotion::default());
            let mut chain = seen(4, &[moved(0.0, 1.0)]);
            let id = chain.choose(Choice::Largest, false).expect("confirmed").id;
            chain.policy.park(id, moved(0.0, 1.0));
            chain.see(&[moved(0.0, 1.0)], still);
            assert_eq!(chain.chosen(), None);
            for n in 1..=40 {
                let mix = |from: f32, to: f32| from + (to - from) * (n as f32 / 10.0).min(1.0);
                let from = moved(0.0, 1.0);
                let step = at(
                    mix(from.x, bounds.x),
                    mix(from.y, bounds.y),
                    mix(from.width, bounds.width),
                    mix(from.height, bounds.height),
                );
                chain.see(&[step], still);
            }
            assert_eq!(chain.chosen().is_some(), chosen, "{bounds:?}");
        }
    }

    #[test]
    fn a_click_means_the_smallest_track_there() {
        let chain = seen(1, &[at(100.0, 40.0, 240.0, 400.0), at(400.0, 200.0, 30.0, 60.0)]);
        let x = |x, y| clicked(&chain.tracks, Point2f::new(x, y)).map(|track| track.seen_bounds().x);
        assert_eq!(x(405.0, 220.0), Some(400.0));
        assert_eq!(x(220.0, 120.0), Some(100.0));
        assert_eq!(x(600.0, 20.0), None);
    }

    #[test]
    fn who_was_seen_beside_the_target_is_somebody_else() {
        let target = at(300.0, 100.0, 40.0, 90.0);
        let mut chain = seen(4, &[target, at(60.0, 100.0, 40.0, 90.0)]);
        for is_another in [false, false, true] {
            let beside: Vec<_> = chain.tracks.seen().map(Track::is_another).collect();
            assert_eq!(beside.contains(&true), is_another);
            let id = clicked(&chain.tracks, centre(target)).map_or(0, |track| track.id);
            tell_apart(&mut chain.tracks, id, target, DT / 2.0);
        }
        assert!(clicked(&chain.tracks, centre(target)).is_some_and(|track| !track.is_another()));
    }

    #[test]
    fn a_leg_goes_before_the_body() {
        let (leg, body, bystander) =
            (at(20.0, 300.0, 30.0, 100.0), at(0.0, 120.0, 45.0, 160.0), at(0.0, 120.0, 15.0, 280.0));
        let chosen = |regions: &[Rect2f]| seen(5, regions).chosen();
        assert_eq!(chosen(&[leg]), Some(leg), "of a dog, say");
        assert_eq!(chosen(&[leg, body]), None);
        assert_eq!(chosen(&[leg, bystander]), Some(leg), "beside it");
        let inside = at(6.0, 120.0, 45.0, 160.0);
        assert_eq!(chosen(&[leg, inside]), Some(inside), "all of the body");
    }
}
