// SPDX-License-Identifier: MPL-2.0

//! Several people who are followed as one, by a box that holds all of them.

use opencv::core::{Point2f, Rect2f};

use super::ego_motion::EgoMotion;
use super::geometry::{around, centre, mean};
use super::tracks::{Track, Tracks};

/// Time constant with which the box takes in who joins and lets go of who has left, seconds: the camera is not to jump.
const GLIDE_S: f32 = 0.5;

/// Who is followed together. Pixels of the picture.
#[derive(Debug, Default)]
pub(super) struct Group {
    members: Vec<u64>,
    /// The box of the last picture.
    bounds: Option<Rect2f>,
}

/// What is known of a group.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct GroupEstimate {
    /// How many are in it.
    pub people: usize,
    pub bounds: Rect2f,
    /// Its mean motion against the background, pixels per second.
    pub own_velocity: Point2f,
}

impl Group {
    /// Nobody is in it.
    pub fn disband(&mut self) {
        self.members.clear();
        self.bounds = None;
    }

    /// The numbers of all who are in it.
    pub fn members(&self) -> impl Iterator<Item = u64> + '_ {
        self.members.iter().copied()
    }

    /// Whoever is `ready` to be followed joins, and is in it until there is nobody any more of that number or nobody is to
    /// follow them. The target, where there is one, is in it at any rate.
    pub fn gather<'a>(
        &mut self,
        tracks: &Tracks,
        ready: impl Iterator<Item = &'a Track>,
        target: Option<u64>,
        is_unwanted: impl Fn(&Track) -> bool,
    ) {
        self.members.retain(|id| tracks.get(*id).is_some_and(|track| !is_unwanted(track)));
        for id in ready.map(|track| track.id).chain(target) {
            if !self.members.contains(&id) {
                self.members.push(id);
            }
        }
    }

    /// The box around all of them, `dt_s` after the last one; `ego` is how the background moved since, where that is known. `None` where
    /// nobody is in it.
    pub fn follow(&mut self, tracks: &Tracks, ego: Option<EgoMotion>, dt_s: f32) -> Option<GroupEstimate> {
        let members = || self.members.iter().filter_map(|id| tracks.get(*id));
        let Some(all) = members().map(Track::bounds).reduce(|all, one| all | one) else {
            self.disband();
            return None;
        };
        let own_velocity = mean(members().map(Track::velocity)).unwrap_or_default();
        let bounds = match self.bounds.zip(ego) {
            Some((last, ego)) => {
                // Each side goes as whoever is outermost there.
                let step = |out: fn(Rect2f) -> f32| {
                    let outermost = members().max_by(|a, b| out(a.bounds()).total_cmp(&out(b.bounds())));
                    outermost.map_or_else(Point2f::default, Track::velocity) * dt_s
                };
                let first = Point2f::new(step(|bounds| -bounds.x).x, step(|bounds| -bounds.y).y);
                let end = Point2f::new(step(|bounds| bounds.br().x).x, step(|bounds| bounds.br().y).y);
                let last = ego.apply_to(last);
                let expected = Rect2f::from_points(last.tl() + first, last.br() + end);
                glide(expected, all, dt_s / (dt_s + GLIDE_S))
            }
            None => all,
        };
        self.bounds = Some(bounds);
        Some(GroupEstimate { people: members().count(), bounds, own_velocity })
    }
}

/// Goes that part of the way from one box to another.
fn glide(from: Rect2f, to: Rect2f, part: f32) -> Rect2f {
    let middle = centre(from) + (centre(to) - centre(from)) * part;
    let side = |from: f32, to: f32| from + (to - from) * part;
    around(middle, side(from.width, to.width), side(from.height, to.height))
}

#[cfg(test)]
mod tests {
    use super::super::tracks::seen_in;
    use super::*;

    const DT: f64 = 0.1;
    const STILL: Option<EgoMotion> = None;
    const MAN: Rect2f = Rect2f { x: 100.0, y: 100.0, width: 40.0, height: 90.0 };
    const WOMAN: Rect2f = Rect2f { x: 400.0, y: 120.0, width: 40.0, height: 90.0 };

    /// Tracks after those regions were seen for half a second.
    fn seen(tracks: &mut Tracks, regions: &[Rect2f]) {
        for _ in 0..5 {
            seen_in(tracks, regions, Some(EgoMotion::default()), DT);
        }
    }

    fn near(a: Rect2f, b: Rect2f) -> bool {
        [a.x - b.x, a.y - b.y, a.width - b.width, a.height - b.height].iter().all(|off| off.abs() < 3.0)
    }

    fn follow(group: &mut Group, tracks: &Tracks) -> Rect2f {
        group.gather(tracks, tracks.iter(), Some(1), |_| false);
        group.follow(tracks, Some(EgoMotion::default()), DT as f32).expect("somebody").bounds
    }

    #[test]
    fn the_box_holds_everybody() {
        let mut tracks = Tracks::default();
        seen(&mut tracks, &[MAN, WOMAN]);
        assert!(near(follow(&mut Group::default(), &tracks), MAN | WOMAN));
    }

    #[test]
    fn who_joins_is_taken_in_gently() {
        let (mut tracks, mut group) = (Tracks::default(), Group::default());
        seen(&mut tracks, &[MAN]);
        assert!(near(follow(&mut group, &tracks), MAN));
        seen(&mut tracks, &[MAN, WOMAN]);
        let first = follow(&mut group, &tracks);
        assert!(first.br().x > MAN.br().x + 20.0 && first.br().x < WOMAN.x, "{first:?}");
        for _ in 0..40 {
            follow(&mut group, &tracks);
        }
        assert!(near(follow(&mut group, &tracks), MAN | WOMAN));
    }

    #[test]
    fn who_stands_is_no_longer_in_it() {
        let (mut tracks, mut group) = (Tracks::default(), Group::default());
        seen(&mut tracks, &[MAN, WOMAN]);
        follow(&mut group, &tracks);
        for _ in 0..40 {
            group.gather(&tracks, std::iter::empty(), Some(1), |track| track.bounds().x > 200.0);
            group.follow(&tracks, Some(EgoMotion::default()), DT as f32);
        }
        let left = group.follow(&tracks, Some(EgoMotion::default()), DT as f32).unwrap();
        assert!(near(left.bounds, MAN), "{left:?}");
    }

    #[test]
    fn where_nobody_knows_how_the_camera_moved_it_begins_anew() {
        let (mut tracks, mut group) = (Tracks::default(), Group::default());
        seen(&mut tracks, &[MAN]);
        follow(&mut group, &tracks);
        seen(&mut tracks, &[MAN, WOMAN]);
        group.gather(&tracks, tracks.iter(), Some(1), |_| false);
        assert!(near(group.follow(&tracks, STILL, DT as f32).unwrap().bounds, MAN | WOMAN));
        group.disband();
        assert_eq!(group.follow(&tracks, STILL, DT as f32), None);
    }
}
