// SPDX-License-Identifier: MPL-2.0

//! By which words the camera is brought to rest, and what is said of a swing.

use super::*;

const ZOOM: Command =
    Command::Move { motion: Motion::Velocity { pan: 0.0, tilt: 0.0, zoom: Some(0.2) }, free: false };
const TURN: Command =
    Command::Move { motion: Motion::Velocity { pan: 0.1, tilt: 0.0, zoom: None }, free: false };

fn accept(rig: &mut Rig, command: Command) {
    let request = Request::Command(command);
    rig.control.sending(&request, rig.now);
    rig.control.on_response(&request, Ok(Response::Accepted), rig.now, rig.now);
}

#[test]
fn a_zoom_is_ended_even_where_the_last_move_was_only_a_turn() {
    let mut rig = Rig::new(ServoSettings::default());
    accept(&mut rig, ZOOM);
    accept(&mut rig, TURN);
    rig.control.release();
    assert_eq!(rig.after(ms(10)), [REST]);
    accept(&mut rig, TURN);
    rig.control.release();
    assert_eq!(rig.after(ms(10)), [HALT], "it rests since");
    accept(&mut rig, ZOOM);
    accept(
        &mut rig,
        Command::Move { motion: Motion::Velocity { pan: 0.1, tilt: 0.0, zoom: Some(0.0) }, free: false },
    );
    rig.control.release();
    assert_eq!(rig.after(ms(10)), [HALT]);
}

#[test]
fn a_zoom_that_went_unanswered_may_be_under_way() {
    let mut rig = Rig::new(ServoSettings::default());
    let request = Request::Command(ZOOM);
    rig.control.sending(&request, rig.now);
    rig.control.on_response(&request, Err(Error::Timeout(ms(1))), rig.now, rig.now);
    rig.now += ms(500);
    assert!(rig.control.servo().is_zooming(rig.now));
    accept(&mut rig, TURN);
    assert!(rig.control.servo().is_zooming(rig.now), "a turn leaves it alone");
    rig.control.release();
    assert_eq!(rig.after(ms(10)), [REST]);
    assert!(!rig.control.servo().is_zooming(rig.now));
}

#[test]
fn a_camera_found_turning_is_told_to_end_its_zoom_too() {
    let mut rig = Rig { control: control_loop(ServoSettings::default()), now: ms(1000), sent: Vec::new() };
    for turn in 0..10 {
        rig.now += ms(500);
        rig.run_jobs(|request| {
            let position = Position { pan_deg: Some(turn.into()), tilt_deg: Some(0.0), zoom: Some(0.0) };
            (*request == Request::Query(Query::Position)).then_some(Ok(Response::Position(position)))
        });
    }
    assert_eq!(rig.sent, [REST]);
}

/// How often a swing is reported of targets that go to and fro; each is another after so many half waves.
fn swings(half_waves: u64) -> usize {
    let mut rig = Rig::new(ServoSettings::default());
    for half_wave in 0..24u64 {
        for _ in 0..10 {
            rig.now += ms(40);
            let x = if half_wave % 2 == 0 { 0.9 } else { 0.1 };
            let id = half_wave / half_waves;
            rig.control.measure(Measurement { id, ..Measurement::at(x, 0.5, rig.now) }, rig.now);
            rig.after(ms(0));
        }
    }
    rig.reports().iter().filter(|report| matches!(report, LoopEvent::Oscillating(_))).count()
}

#[test]
fn what_several_targets_do_is_no_swing() {
    assert!(swings(24) > 0);
    assert_eq!(swings(3), 0);
}
