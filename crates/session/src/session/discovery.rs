// SPDX-License-Identifier: MPL-2.0

use std::collections::VecDeque;
use std::time::Duration;

use servo::Time;

use crate::Query;

/// What is still to be asked of the camera, just met or met again.
#[derive(Debug)]
pub struct Discovery {
    /// What a camera just met is asked, what matters most first.
    questions: &'static [Query],
    pending: VecDeque<Pending>,
    next_at: Time,
    /// What was last told of the camera.
    told: Option<String>,
}

#[derive(Debug)]
struct Pending {
    query: Query,
    /// How often it went unanswered.
    tries: u32,
    /// The camera is not to be moved before it was asked this.
    vital: bool,
}

impl Pending {
    fn new(query: Query) -> Self {
        Self { query, tries: 0, vital: matches!(query, Query::Position | Query::Limits) }
    }
}

impl Discovery {
    /// What goes unanswered so often is not asked again.
    const TRIES: u32 = 3;

    /// From a question without an answer to the next: time to see whether the camera is there at all.
    const PAUSE: Duration = Duration::from_secs(1);

    /// All of these are to be asked, what matters most first.
    pub fn new(questions: &'static [Query]) -> Self {
        let pending = questions.iter().copied().map(Pending::new).collect();
        Self { questions, pending, next_at: Time::ZERO, told: None }
    }

    /// What holds at any time.
    pub fn check_invariants(&self) {
        for (index, pending) in self.pending.iter().enumerate() {
            assert!(pending.tries < Self::TRIES, "asked too often: {self:?}");
            let twice = self.pending.iter().skip(index + 1).any(|other| other.query == pending.query);
            assert!(!twice, "to be asked twice: {self:?}");
        }
    }

    /// What to ask next, and when.
    pub fn next(&self) -> Option<(Query, Time)> {
        self.pending.front().map(|pending| (pending.query, self.next_at))
    }

    /// Whether this is still to be asked.
    pub fn holds(&self, query: Query) -> bool {
        self.pending.iter().any(|pending| pending.query == query)
    }

    /// Whether the camera was not asked yet where it looks and how far it can, without which it is not to be moved.
    pub fn comes_first(&self) -> bool {
        self.pending.iter().any(|pending| pending.vital)
    }

    /// This is to be asked before all else.
    pub fn ask_first(&mut self, query: Query) {
        self.done(query);
        self.pending.push_front(Pending::new(query));
    }

    /// All is to be asked once more, while the camera is moved by what it told before. Where it looks it is asked anyway.
    pub fn renew(&mut self) {
        for pending in &mut self.pending {
            pending.tries = 0;
        }
        for query in self.questions.iter().copied() {
            if query != Query::Position && !self.holds(query) {
                self.pending.push_back(Pending { vital: false, ..Pending::new(query) });
            }
        }
    }

    /// This need not be asked again. Returns whether it was the last.
    pub fn done(&mut self, query: Query) -> bool {
        let before = self.pending.len();
        self.pending.retain(|pending| pending.query != query);
        before > 0 && self.pending.is_empty()
    }

    /// The camera is known by now as this; returns it where that is another than was told.
    pub fn changed(&mut self, camera: String) -> Option<String> {
        (self.told.as_ref() != Some(&camera)).then(|| self.told.insert(camera).clone())
    }

    /// This went unanswered: it is asked again after the others, if it is worth it. `counts`: as one of the tries.
    /// Returns whether nothing is left to ask.
    pub fn unanswered(&mut self, query: Query, counts: bool, now: Time) -> bool {
        self.next_at = now + Self::PAUSE;
        let Some(index) = self.pending.iter().position(|pending| pending.query == query) else {
            return false;
        };
        let tries = self.pending[index].tries + u32::from(counts);
        let last = self.done(query);
        if tries >= Self::TRIES {
            return last;
        }
        self.pending.push_back(Pending { query, tries, vital: false });
        false
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const QUESTIONS: [Query; 5] =
        [Query::Position, Query::Limits, Query::Attributes, Query::Parameters, Query::MoveSpeed];

    const NOW: Time = Time::from_millis(7000);

    #[test]
    fn what_goes_unanswered_is_asked_again_last_and_not_for_ever() {
        let mut discovery = Discovery::new(&QUESTIONS);
        assert!(!discovery.done(Query::Position) && discovery.comes_first());
        assert!(!discovery.unanswered(Query::Limits, true, NOW));
        assert!(discovery.holds(Query::Limits) && !discovery.comes_first(), "but it may be moved");
        assert_eq!(discovery.next(), Some((Query::Attributes, NOW + Discovery::PAUSE)));
        for query in [Query::Attributes, Query::Parameters, Query::MoveSpeed] {
            assert!(!discovery.done(query));
        }
        for _ in 0..5 {
            assert!(!discovery.unanswered(Query::Limits, false, NOW));
        }
        assert!(!discovery.unanswered(Query::Limits, true, NOW));
        assert!(discovery.unanswered(Query::Limits, true, NOW), "the third time");
        assert_eq!(discovery.next(), None);
        assert!(!discovery.done(Query::Limits) && !discovery.unanswered(Query::Limits, true, NOW));
    }

    #[test]
    fn a_witness_comes_before_all_else() {
        let mut discovery = Discovery::new(&QUESTIONS);
        discovery.ask_first(Query::Parameters);
        assert_eq!(discovery.next(), Some((Query::Parameters, Time::ZERO)));
        assert!(!discovery.done(Query::Parameters) && !discovery.holds(Query::Parameters));
    }

    #[test]
    fn all_is_asked_once_more_without_keeping_the_camera_from_being_moved() {
        let mut discovery = Discovery::new(&QUESTIONS);
        discovery.renew();
        assert!(discovery.comes_first(), "it was not asked at all yet");
        for query in QUESTIONS {
            discovery.done(query);
        }
        for query in [Query::Limits, Query::Attributes, Query::Parameters, Query::MoveSpeed] {
            discovery.renew();
            assert!(discovery.holds(query) && !discovery.holds(Query::Position));
            assert!(!discovery.comes_first());
            discovery.done(query);
        }
        discovery.unanswered(Query::Limits, true, NOW);
        discovery.unanswered(Query::Limits, true, NOW);
        discovery.renew();
        discovery.unanswered(Query::Limits, true, NOW);
        assert!(discovery.holds(Query::Limits), "the tries are counted anew");
    }
}
