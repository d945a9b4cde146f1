// SPDX-License-Identifier: MPL-2.0

use std::time::Duration;

use servo::{CommandHistory, PanTilt, Time};

/// What was commanded.
#[derive(Debug, Clone, Copy)]
pub struct CommandedMotion<'a> {
    /// Rates of pan and tilt.
    pub pan_tilt: &'a CommandHistory,
    /// Speeds of the zoom, as the pan of a history; `None`: the zoom is anybody's.
    pub zoom: Option<&'a CommandHistory>,
}

/// Tells from the positions a camera reports whether somebody else moves it.
///
/// An operator who is missed is fought for a moment; one who is seen where there is none costs the target. So only what no
/// command of ours, however late, slow or fast, can explain counts: a turn or zoom of an axis in a direction that it was not
/// told, of more than any noise, and still there when asked again. A single short turn that our own outweighs before the
/// camera is asked the next time is missed: a slow camera would have come as far.
#[derive(Debug, Default)]
pub struct OperatorDetector {
    /// Where the camera has stood since it last moved at our word, and when it was last asked.
    place: Option<Place>,
    /// One turn of the camera was seen that is ours, or none: what follows is not its way of starting up.
    armed: bool,
    suspects: bool,
    /// Whether the last position was off by a turn that nobody commanded, not by a zoom.
    turns_otherwise: bool,
    /// Until then it may turn any way at our word.
    excused_until: Time,
}

#[derive(Debug, Clone, Copy)]
struct Place {
    position: PanTilt,
    zoom: Option<f64>,
    asked: Time,
}

impl Place {
    /// This, but where the camera was before.
    fn seen_from(self, before: &Self) -> Self {
        // Where the zoom was is forgotten while it is anybody's.
        let zoom = self.zoom.map(|now| before.zoom.unwrap_or(now));
        Self { position: before.position, zoom, ..self }
    }
}

/// What a position tells.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// Nothing that we, or nobody, could not have done.
    Ours,
    /// Something; the camera is to be asked again before anything else.
    Suspicious,
    /// Somebody else moves it.
    Foreign,
}

impl OperatorDetector {
    /// Turns up to this come from noise, from whole degrees told, from an end that springs back.
    const TOLERANCE_DEG: f64 = 1.5;

    /// So do zooms up to this part of the travel, and from a lens that settles.
    const TOLERANCE_ZOOM: f64 = 0.01;

    /// A command acts no later than this, rest included, and positions are no older.
    const LATEST: Duration = Duration::from_secs(2);

    /// Of a moving camera that was not asked for longer, nobody can tell which way it went.
    const LONGEST: Duration = Duration::from_secs(3);

    /// A pan by more may have gone either way round.
    const CLEAR_DEG: f64 = 90.0;

    /// Tilted this steeply, a camera may swing round by itself to keep the picture upright (AutoFlip).
    const STEEP_DEG: f64 = 75.0;

    /// Judges a position that was asked for and answered then.
    pub fn position(
        &mut self,
        (position, zoom): (PanTilt, Option<f64>),
        (asked, answered): (Time, Time),
        commands: CommandedMotion,
    ) -> Verdict {
        let zoom = commands.zoom.and(zoom);
        let place = Place { position, zoom, asked };
        let Some(before) = self.place else {
            self.place = Some(place);
            return Verdict::Ours;
        };
        let excused = before.asked <= self.excused_until;
        let acting = (before.asked - Self::LATEST, answered);
        let explains_zoom = |zoom| explains_zoom(&before, &place, acting, zoom);
        self.turns_otherwise = !excused && !explains_turn(&before, &place, acting, commands.pan_tilt);
        if !self.turns_otherwise && (excused || commands.zoom.is_none_or(explains_zoom)) {
            let alone = !excused && is_still(acting, commands);
            // What turns slowly by somebody's hand turns far in time.
            let place = if alone { place.seen_from(&before) } else { place };
            *self = Self { place: Some(place), armed: true, suspects: false, ..*self };
            return Verdict::Ours;
        }
        if !self.armed {
            self.place = Some(place);
            return Verdict::Ours;
        }
        if !self.suspects {
            self.suspects = true;
            return Verdict::Suspicious;
        }
        *self = Self { place: Some(place), suspects: false, ..*self };
        Verdict::Foreign
    }

    /// At this time the camera may turn any way at our word.
    pub fn excuse(&mut self, now: Time) {
        self.excused_until = self.excused_until.max(now + Self::LATEST);
    }

    /// The camera was out of sight: what it did meanwhile, and does until it is seen at rest, is nobody's.
    pub fn forget(&mut self) {
        *self = Self { excused_until: self.excused_until, ..Self::default() };
    }

    /// The position that was to decide did not come: whoever moved it will be noticed again.
    pub fn undecided(&mut self) {
        self.suspects = false;
    }

    /// What holds at any time.
    pub fn check_invariants(&self) {
        assert!(!self.suspects || self.armed && self.place.is_some(), "it suspects somebody by no place");
    }

    /// Whether pan or tilt turned otherwise than commanded when last seen.
    pub fn turns_otherwise(&self) -> bool {
        self.turns_otherwise
    }

    /// Whether the next position decides.
    pub fn suspects(&self) -> bool {
        self.suspects
    }
}

/// Whether no command could move the camera then.
fn is_still((since, answered): (Time, Time), commands: CommandedMotion) -> bool {
    let rests =
        |history: &CommandHistory| history.rates_between(since, answered).all(|rate| rate.largest() == 0.0);
    rests(commands.pan_tilt) && commands.zoom.is_none_or(rests)
}

fn explains_turn(
    before: &Place,
    place: &Place,
    (since, answered): (Time, Time),
    commands: &CommandHistory,
) -> bool {
    let turn = before.position.turn_to(place.position);
    let rates: Vec<PanTilt> = commands.rates_between(since, answered).collect();
    let still = rates.iter().all(|rate| rate.largest() == 0.0);
    if !still {
        let steep = before.position.tilt.abs().max(place.position.tilt.abs()) > OperatorDetector::STEEP_DEG;
        let long = answered - before.asked > OperatorDetector::LONGEST;
        if steep || long {
            return true;
        }
    }
    let commanded = commands.rotation(since, answered);
    let unclear = !still && turn.pan.abs().max(commanded.pan.abs()) > OperatorDetector::CLEAR_DEG;
    let tolerance = OperatorDetector::TOLERANCE_DEG;
    (unclear || told(turn.pan, tolerance, rates.iter().map(|rate| rate.pan)))
        && told(turn.tilt, tolerance, rates.iter().map(|rate| rate.tilt))
}

fn explains_zoom(
    before: &Place,
    place: &Place,
    (since, answered): (Time, Time),
    commands: &CommandHistory,
) -> bool {
    let zoomed = before.zoom.zip(place.zoom).map_or(0.0, |(from, to)| to - from);
    let speeds = commands.rates_between(since, answered).map(|rate| rate.pan);
    told(zoomed, OperatorDetector::TOLERANCE_ZOOM, speeds)
}

/// Whether an axis was told to move that way at any time.
fn told(moved: f64, tolerance: f64, mut rates: impl Iterator<Item = f64>) -> bool {
    moved.abs() <= tolerance || rates.any(|rate| rate * moved > 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use servo::around_deg;

    fn ms<T: From<Duration>>(ms: u64) -> T {
        Duration::from_millis(ms).into()
    }

    /// A watch that is told positions, one a second, each answered after 100 ms.
    #[derive(Default)]
    struct Rig {
        watch: OperatorDetector,
        commands: CommandHistory,
        zooms: CommandHistory,
        zoom: f64,
        now: Time,
    }

    impl Rig {
        fn armed() -> Self {
            let mut rig = Self { now: ms(10_000), ..Self::default() };
            assert_eq!(rig.tell(0.0, 0.0), Verdict::Ours);
            assert_eq!(rig.tell(0.0, 0.0), Verdict::Ours);
            rig
        }

        fn tell(&mut self, pan: f64, tilt: f64) -> Verdict {
            self.tell_after(ms(1000), pan, tilt)
        }

        fn tell_after(&mut self, wait: Duration, pan: f64, tilt: f64) -> Verdict {
            self.now += wait;
            let asked = self.now - Duration::from_millis(100);
            let place = (PanTilt::new(pan, tilt), Some(self.zoom));
            let commands = CommandedMotion { pan_tilt: &self.commands, zoom: Some(&self.zooms) };
            self.watch.position(place, (asked, self.now), commands)
        }

        fn command(&mut self, pan: f64, tilt: f64) {
            self.commands.push(self.now, PanTilt::new(pan, tilt));
        }
    }

    #[test]
    fn a_resting_camera_that_turns_is_moved_by_somebody() {
        for (pan, tilt) in [(10.0, 0.0), (-2.0, 0.0), (0.0, 3.0), (170.0, -80.0)] {
            let mut rig = Rig::armed();
            assert_eq!(rig.tell(pan, tilt), Verdict::Suspicious);
            assert!(rig.watch.suspects());
            assert_eq!(rig.tell_after(ms(100), pan, tilt), Verdict::Foreign);
            assert_eq!(rig.tell(pan, tilt), Verdict::Ours, "it rests there");
        }
    }

    #[test]
    fn a_hand_that_turns_slowly_is_noticed_too() {
        for (pan, tilt, zoom) in [(0.4, 0.0, 0.0), (0.0, -0.4, 0.0), (0.0, 0.0, 0.003)] {
            let mut rig = Rig::armed();
            let verdicts: Vec<Verdict> = (1..=5)
                .map(|second| {
                    let turned = f64::from(second);
                    rig.zoom = zoom * turned;
                    rig.tell(pan * turned, tilt * turned)
                })
                .collect();
            assert_eq!(verdicts[2..], [Verdict::Ours, Verdict::Suspicious, Verdict::Foreign]);
        }
    }

    #[test]
    fn a_camera_that_turns_against_its_command_is_moved_by_somebody() {
        let mut rig = Rig::armed();
        rig.command(5.0, 0.0);
        assert_eq!(rig.tell(4.0, 0.0), Verdict::Ours);
        assert_eq!(rig.tell(-3.0, 0.0), Verdict::Suspicious);
        assert_eq!(rig.tell_after(ms(100), -4.0, 0.0), Verdict::Foreign);
        let mut rig = Rig::armed();
        rig.command(5.0, 0.0);
        assert_eq!(rig.tell(5.0, 4.0), Verdict::Suspicious, "an axis that was told nothing");
    }

    #[test]
    fn a_single_turn_against_ours_is_noticed_where_ours_does_not_outweigh_it() {
        const TURN_DEG: f64 = -12.0;
        for (our_rate_deg_s, verdict) in [
            (3.0, Verdict::Suspicious),
            (10.0, Verdict::Suspicious),
            (11.0, Verdict::Ours),
            (20.0, Verdict::Ours),
        ] {
            let mut rig = Rig::armed();
            rig.command(our_rate_deg_s, 0.0);
            assert_eq!(rig.tell(our_rate_deg_s, 0.0), Verdict::Ours);
            assert_eq!(rig.tell(2.0 * our_rate_deg_s + TURN_DEG, 0.0), verdict, "{our_rate_deg_s} deg/s");
        }
    }

    #[test]
    fn a_single_turn_just_after_we_turned_round_may_be_ours_that_came_late() {
        let mut rig = Rig::armed();
        rig.command(-10.0, 0.0);
        assert_eq!(rig.tell(-10.0, 0.0), Verdict::Ours);
        rig.command(10.0, 0.0);
        assert_eq!(rig.tell(-22.0, 0.0), Verdict::Ours);
        rig.tell(-12.0, 0.0);
        rig.tell(-2.0, 0.0);
        assert_eq!(rig.tell(-14.0, 0.0), Verdict::Suspicious, "what we told before is long over");
    }

    #[test]
    fn a_zoom_that_was_not_told_is_somebodys_and_one_that_was_is_ours() {
        let mut rig = Rig::armed();
        rig.zooms.push(rig.now, PanTilt::new(0.4, 0.0));
        rig.zoom = 0.09;
        assert_eq!(rig.tell(0.0, 0.0), Verdict::Ours);
        rig.zoom = 0.03;
        assert_eq!(rig.tell(0.0, 0.0), Verdict::Suspicious, "the other way");
        assert_eq!(rig.tell(0.0, 0.0), Verdict::Foreign);
        rig.zooms.push(rig.now, PanTilt::default());
        rig.now += ms(10_000);
        rig.tell(0.0, 0.0);
        rig.zoom = 0.039;
        assert_eq!(rig.tell(0.0, 0.0), Verdict::Ours, "it settles");
        rig.zoom = 0.09;
        assert_eq!(rig.tell(0.0, 0.0), Verdict::Suspicious);
    }

    #[test]
    fn where_the_zoom_is_anybodys_it_tells_nothing() {
        let mut watch = OperatorDetector::default();
        let commands = CommandHistory::default();
        for second in 1..20 {
            let place = (PanTilt::default(), Some(0.05 * second as f64));
            let asked = ms(1000 * second);
            let commands = CommandedMotion { pan_tilt: &commands, zoom: None };
            assert_eq!(watch.position(place, (asked, asked), commands), Verdict::Ours);
        }
    }

    #[test]
    fn one_wrong_answer_is_no_operator() {
        let mut rig = Rig::armed();
        for _ in 0..10 {
            assert_eq!(rig.tell(60.0, -20.0), Verdict::Suspicious);
            assert_eq!(rig.tell_after(ms(100), 0.0, 0.0), Verdict::Ours);
        }
    }

    #[test]
    fn an_operator_is_noticed_later_where_the_deciding_answer_failed() {
        let mut rig = Rig::armed();
        assert_eq!(rig.tell(10.0, 0.0), Verdict::Suspicious);
        rig.watch.undecided();
        assert!(!rig.watch.suspects());
        assert_eq!(rig.tell(10.0, 0.0), Verdict::Suspicious);
        assert_eq!(rig.tell(10.0, 0.0), Verdict::Foreign);
    }

    #[test]
    fn a_camera_at_its_end_is_no_operator() {
        let mut rig = Rig::armed();
        rig.command(30.0, 0.0);
        for pan in [20.0, 20.0, 19.2, 20.0, 20.0] {
            assert_eq!(rig.tell(pan, 0.0), Verdict::Ours);
        }
    }

    #[test]
    fn whole_degrees_are_no_operator() {
        let mut rig = Rig::armed();
        for second in 0..60 {
            assert_eq!(rig.tell(f64::from(second % 2), f64::from(second % 3 - 1) * 0.7), Verdict::Ours);
        }
    }

    #[test]
    fn a_camera_out_of_sight_may_come_back_anywhere_and_turn_to_find_its_zero() {
        let mut rig = Rig::armed();
        rig.watch.forget();
        for pan in [120.0, -60.0, 170.0, 20.0, 0.0, 0.0] {
            assert_eq!(rig.tell(pan, 0.0), Verdict::Ours);
        }
        assert_eq!(rig.tell(5.0, 0.0), Verdict::Suspicious, "that was at rest");
    }

    #[test]
    fn a_move_of_unknown_course_is_excused_while_it_may_last() {
        let mut rig = Rig::armed();
        rig.watch.excuse(rig.now);
        assert_eq!(rig.tell(40.0, 5.0), Verdict::Ours);
        assert_eq!(rig.tell(60.0, 5.0), Verdict::Ours);
        rig.tell(60.0, 5.0);
        rig.tell(60.0, 5.0);
        assert_eq!(rig.tell(20.0, 5.0), Verdict::Suspicious);
    }

    #[test]
    fn where_an_excused_move_began_is_no_place_to_stand() {
        let mut rig = Rig::armed();
        rig.watch.excuse(rig.now + ms(6000));
        assert_eq!(rig.tell_after(ms(5000), 0.0, 0.0), Verdict::Ours);
        // It acted late.
        for _ in 0..5 {
            assert_eq!(rig.tell_after(ms(5000), 12.0, 0.0), Verdict::Ours);
        }
    }

    #[test]
    fn flips_and_long_silences_of_a_moving_camera_say_nothing() {
        let mut rig = Rig::armed();
        rig.command(0.0, -20.0);
        assert_eq!(rig.tell(175.0, -80.0), Verdict::Ours, "AutoFlip");
        let mut rig = Rig::armed();
        rig.command(5.0, 0.0);
        assert_eq!(rig.tell_after(ms(5000), -80.0, 0.0), Verdict::Ours);
    }

    proptest! {
        /// Whatever we command: late by up to the longest latency, and as fast or slow as it will, it is ours.
        #[test]
        fn our_own_commands_are_no_operator(
            moves in prop::collection::vec((-60.0..60.0f64, -30.0..30.0f64, 1u32..20), 1..12),
            latency_steps in 0usize..19, slow_or_fast in 0.1..1.4f64, end in 15.0..200.0f64,
            coarse in prop::sample::select(vec![0.001, 0.1, 1.0]), noise in 0.0..0.2f64,
        ) {
            const STEP: Duration = Duration::from_millis(100);
            let mut rig = Rig::armed();
            let (mut at, mut late) = (PanTilt::default(), vec![PanTilt::default(); latency_steps]);
            let wobble = |tick: u64| noise * if tick.is_multiple_of(3) { 1.0 } else { -1.0 };
            let mut ticks = 0u64;
            for (pan, tilt, steps) in moves.into_iter().chain([(0.0, 0.0, 60)]) {
                rig.command(pan, tilt);
                for _ in 0..steps {
                    late.push(PanTilt::new(pan, tilt));
                    let rate = late.remove(0) * slow_or_fast;
                    at = at + rate * STEP.as_secs_f64();
                    at = PanTilt::new(at.pan.clamp(-end, end), at.tilt.clamp(-70.0, 20.0));
                    ticks += 1;
                    if ticks.is_multiple_of(10) {
                        let told = |angle: f64| ((angle + wobble(ticks / 10)) / coarse).round() * coarse;
                        let told_pan = around_deg(0.0, told(at.pan));
                        prop_assert_eq!(rig.tell_after(STEP, told_pan, told(at.tilt)), Verdict::Ours);
                    } else {
                        rig.now += STEP;
                    }
                }
            }
        }
    }
}
