// SPDX-License-Identifier: MPL-2.0

//! What a camera's process and the one that started it tell each other: one object of JSON on a line. Both are the same program.

use std::collections::BTreeSet;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use axum::body::Bytes;
use events::Sighting;
use ptztrack_contract::lock::lock;
use serde::{Deserialize, Serialize};

use crate::camera::Packet;
use crate::camera::known::{Control, Gaze, Known, State, Steering};
use crate::camera::servo_stats::ServoStats;
use crate::camera::sight::Sight;
use crate::camera::view::Seen;
use crate::camera::{Abilities, Turn};
use crate::config::CameraSettings;
use crate::event::Event;

/// The first line, to the process of a camera.
#[derive(Debug, Serialize, Deserialize)]
pub struct Start {
    pub settings: CameraSettings,
    /// Who had the camera before.
    pub control: Control,
    /// User and password have worked before.
    pub worked: bool,
}

/// All further ones.
#[derive(Debug, Serialize, Deserialize)]
pub enum Order {
    Select {
        x: f64,
        y: f64,
    },
    SelectTrack(u64),
    Ignore(BTreeSet<u64>),
    Release,
    Steer(Hand),
    Turn(Turn),
    Look(bool),
    /// Somebody takes the packets of its stream.
    Stream(bool),
}

/// What the process of a camera says.
#[derive(Debug, Serialize, Deserialize)]
pub enum Word {
    Event(Event),
    Report(Box<Report>),
    /// Somebody was followed.
    Sighting(Box<Sighting>),
    /// For who looks: JPEG in base64, and what the tracker says of it.
    Picture(#[serde(with = "super::bytes")] Bytes, Option<Seen>),
    /// Of its stream, for who passes it on.
    Packet(Box<Packet>),
    /// What it sees, and how long ago that was.
    Sight(Duration, Sight),
}

/// In whose hand a camera is; a [`Steering`] without its times.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Hand {
    Follow,
    GoHome,
    LookAt(Gaze),
    TurnBack(Gaze),
    HandedOver,
    Turned(Gaze),
    Operator,
}

/// All that is known of a camera.
#[derive(Debug, Serialize, Deserialize)]
pub struct Report {
    state: State,
    hand: Hand,
    operator: bool,
    pictures: u64,
    processed: u64,
    rebuilt: u64,
    failures: u64,
    since_picture: Duration,
    times: Vec<(u64, f64)>,
    /// What the sink says of itself.
    pub servo: Option<ServoStats>,
    pub abilities: Abilities,
    /// How many orders had been heard.
    orders: u64,
    pub stuck: bool,
}

impl From<Steering> for Hand {
    fn from(steering: Steering) -> Self {
        match steering {
            Steering::Follow => Self::Follow,
            Steering::GoHome(_) => Self::GoHome,
            Steering::LookAt(gaze, _) => Self::LookAt(gaze),
            Steering::TurnBack(gaze, _) => Self::TurnBack(gaze),
            Steering::HandedOver => Self::HandedOver,
            Steering::Turned(gaze, _) => Self::Turned(gaze),
            Steering::Operator(_) => Self::Operator,
        }
    }
}

impl From<Hand> for Steering {
    /// From now on.
    fn from(hand: Hand) -> Self {
        match hand {
            Hand::Follow => Self::Follow,
            Hand::GoHome => Self::GoHome(Instant::now()),
            Hand::LookAt(gaze) => Self::LookAt(gaze, Instant::now()),
            Hand::TurnBack(gaze) => Self::TurnBack(gaze, Instant::now()),
            Hand::HandedOver => Self::HandedOver,
            Hand::Turned(gaze) => Self::Turned(gaze, Instant::now()),
            Hand::Operator => Self::Operator(Instant::now()),
        }
    }
}

impl Report {
    /// After so many orders.
    pub fn of(known: &Known, orders: u64) -> Self {
        let count = |counter: &AtomicU64| counter.load(Ordering::Relaxed);
        Self {
            state: lock(&known.state).clone(),
            hand: (*lock(&known.steering)).into(),
            operator: known.operator.load(Ordering::Relaxed),
            pictures: count(&known.pictures),
            processed: count(&known.processed),
            rebuilt: count(&known.rebuilt),
            failures: count(&known.failures),
            since_picture: known.since_picture(),
            times: known.times.iter().map(super::super::Stopwatch::read).collect(),
            servo: known.servo(),
            abilities: known.abilities(),
            orders,
            stuck: known.is_stuck(),
        }
    }

    /// Makes it known here, where so many orders are `given`.
    pub fn tell(&self, known: &Known, given: &AtomicU64) {
        *lock(&known.state) = self.state.clone();
        let mut steering = lock(&known.steering);
        // Before it has heard them all, it knows less of that than we do. Nobody steers between question and answer.
        if self.orders == given.load(Ordering::SeqCst) {
            *steering = self.hand.into();
            known.operator.store(self.operator, Ordering::Relaxed);
        }
        drop(steering);
        if known.rebuilt.load(Ordering::Relaxed) != self.rebuilt {
            known.forget_tracks();
        }
        let counters = [
            (&known.pictures, self.pictures),
            (&known.processed, self.processed),
            (&known.rebuilt, self.rebuilt),
            (&known.failures, self.failures),
        ];
        for (counter, value) in counters {
            counter.store(value, Ordering::Relaxed);
        }
        known.worked.fetch_or(self.processed > 0, Ordering::Relaxed);
        known.last_picture_was(self.since_picture);
        for (stopwatch, time) in known.times.iter().zip(&self.times) {
            stopwatch.set(*time);
        }
        if !self.stuck {
            known.beat();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_known_there_is_known_here() {
        gst::init().unwrap();
        let there = Known::new("door");
        lock(&there.state).picture = true;
        there.pictures.store(7, Ordering::Relaxed);
        there.processed.store(1, Ordering::Relaxed);
        *lock(&there.steering) = Steering::HandedOver;
        there.times[0].set((3, 0.5));
        let line = serde_json::to_string(&Word::Report(Box::new(Report::of(&there, 2)))).unwrap();
        let Ok(Word::Report(report)) = serde_json::from_str(&line) else { panic!("{line}") };
        let here = Known::new("door");
        here.ignored.lock().unwrap().insert(7);
        report.tell(&here, &AtomicU64::new(3));
        assert_eq!(here.ignored.lock().unwrap().len(), 1, "it is the same pipeline");
        assert_eq!(here.control(), Control::Ours, "an order is on its way");
        report.tell(&here, &AtomicU64::new(2));
        assert_eq!(here.control(), Control::HandedOver);
        assert!(lock(&here.state).picture && here.worked.load(Ordering::Relaxed));
        assert_eq!((here.pictures.load(Ordering::Relaxed), here.times[0].read()), (7, (3, 0.5)));
        assert!(!here.is_stuck());
        Report { rebuilt: 1, ..*report }.tell(&here, &AtomicU64::new(2));
        assert!(here.ignored.lock().unwrap().is_empty(), "its tracks have other numbers");
    }
}
