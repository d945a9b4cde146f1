//! The camera in others' hands, or perhaps in others' hands.

use super::*;
use crate::vapix::{Parameters, QueuePlace};

type Said = Option<Result<Answer, Error>>;

/// A camera with a control queue that says so, and where we stand; `None`: it is full. A stop is taken or not.
fn queued(place: Option<u32>, takes_stops: bool) -> impl Fn(&Job) -> Said {
    move |job| {
        let refused = |text: &str| Some(Err(Error::Camera(text.to_owned())));
        match job {
            Job::Query(Query::Parameters) => {
                let control_queue = Some(true);
                Some(Ok(Answer::Parameters(Parameters { control_queue, ..Parameters::default() })))
            }
            Job::Query(Query::Queue(_)) => {
                let Some(position) = place else { return refused("queue full") };
                let place = QueuePlace { position, left: None, poll_every: ms(10_000) };
                Some(Ok(Answer::Place(Some(place))))
            }
            Job::Command(command) if place != Some(1) && !(takes_stops && command.is_stop()) => {
                refused("not in control")
            }
            _ => None,
        }
    }
}

impl Rig {
    /// A camera that turns, after it was told so in our turn.
    fn turning_in_turn() -> Self {
        let mut rig = Self { pilot: Pilot::new(ServoSettings::default()), now: ms(1000), sent: Vec::new() };
        rig.run_jobs(queued(Some(1), true));
        rig.aside(ms(1000), queued(Some(1), true));
        assert!(!rig.pilot.is_at_rest());
        rig.reports();
        rig
    }

    /// A target far to the right is seen all the time; returns what was sent.
    fn aside(&mut self, time: Duration, answer: impl Fn(&Job) -> Said) -> Vec<Command> {
        self.sent.clear();
        for _ in 0..time.as_millis() / 50 {
            self.now += ms(50);
            self.see(0.9, 0.5);
            self.run_jobs(&answer);
        }
        mem::take(&mut self.sent)
    }
}

#[test]
fn who_loses_the_turn_stops_the_camera() {
    let mut rig = Rig::turning_in_turn();
    rig.aside(ms(6000), queued(Some(2), true));
    assert!(rig.pilot.is_at_rest());
    assert_eq!(rig.aside(ms(30_000), queued(Some(2), true)), []);
}

#[test]
fn a_stop_that_is_refused_out_of_turn_is_tried_at_each_answer_and_says_nothing_of_the_mode() {
    let mut rig = Rig::turning_in_turn();
    rig.aside(ms(6000), queued(Some(2), false));
    assert!(!rig.pilot.is_at_rest());
    rig.pilot.rest();
    assert_eq!(rig.aside(ms(20_000), queued(Some(2), false)), [Command::Halt; 4]);
    let reports = rig.reports();
    let taken = |report: &Report| matches!(report, Report::TakenOver(_));
    assert!(reports.iter().all(taken), "{reports:?}");
    // The end: the place is kept until the camera rests.
    rig.pilot.leave();
    rig.aside(ms(6000), queued(Some(2), false));
    assert!(rig.pilot.is_queued());
    rig.pilot.rest();
    rig.run_jobs(queued(Some(1), false));
    rig.now += ms(6000);
    rig.run_jobs(queued(Some(1), false));
    assert!(rig.pilot.is_at_rest() && !rig.pilot.is_queued());
    assert_eq!(rig.sent.last(), Some(&Command::Halt));
}
