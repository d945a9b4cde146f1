use std::collections::VecDeque;
use std::time::Duration;

use super::Query;

/// What is still to be asked of the camera, just met or met again.
#[derive(Debug)]
pub struct Introduction {
    pending: VecDeque<Pending>,
    next_at: Duration,
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

impl Default for Introduction {
    fn default() -> Self {
        Self { pending: Query::INTRODUCTION.map(Pending::new).into(), next_at: Duration::ZERO }
    }
}

impl Introduction {
    /// What goes unanswered so often is not asked again.
    const TRIES: u32 = 3;

    /// From a question without an answer to the next: time to see whether the camera is there at all.
    const PAUSE: Duration = Duration::from_secs(1);

    /// What to ask next, and when.
    pub fn next(&self) -> Option<(Query, Duration)> {
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
        for query in Query::INTRODUCTION {
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

    /// This went unanswered: it is asked again after the others, if it is worth it. `counts`: as one of the tries.
    /// Returns whether nothing is left to ask.
    pub fn unanswered(&mut self, query: Query, counts: bool, now: Duration) -> bool {
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

    const NOW: Duration = Duration::from_secs(7);

    #[test]
    fn what_goes_unanswered_is_asked_again_last_and_not_for_ever() {
        let mut introduction = Introduction::default();
        assert!(!introduction.done(Query::Position) && introduction.comes_first());
        assert!(!introduction.unanswered(Query::Limits, true, NOW));
        assert!(introduction.holds(Query::Limits) && !introduction.comes_first(), "but it may be moved");
        assert_eq!(introduction.next(), Some((Query::Attributes, NOW + Introduction::PAUSE)));
        for query in [Query::Attributes, Query::Parameters, Query::MoveSpeed] {
            assert!(!introduction.done(query));
        }
        for _ in 0..5 {
            assert!(!introduction.unanswered(Query::Limits, false, NOW));
        }
        assert!(!introduction.unanswered(Query::Limits, true, NOW));
        assert!(introduction.unanswered(Query::Limits, true, NOW), "the third time");
        assert_eq!(introduction.next(), None);
        assert!(!introduction.done(Query::Limits) && !introduction.unanswered(Query::Limits, true, NOW));
    }

    #[test]
    fn a_witness_comes_before_all_else() {
        let mut introduction = Introduction::default();
        introduction.ask_first(Query::Parameters);
        assert_eq!(introduction.next(), Some((Query::Parameters, Duration::ZERO)));
        assert!(!introduction.done(Query::Parameters) && !introduction.holds(Query::Parameters));
    }

    #[test]
    fn all_is_asked_once_more_without_keeping_the_camera_from_being_moved() {
        let mut introduction = Introduction::default();
        introduction.renew();
        assert!(introduction.comes_first(), "it was not asked at all yet");
        for query in Query::INTRODUCTION {
            introduction.done(query);
        }
        for query in [Query::Limits, Query::Attributes, Query::Parameters, Query::MoveSpeed] {
            introduction.renew();
            assert!(introduction.holds(query) && !introduction.holds(Query::Position));
            assert!(!introduction.comes_first());
            introduction.done(query);
        }
        introduction.unanswered(Query::Limits, true, NOW);
        introduction.unanswered(Query::Limits, true, NOW);
        introduction.renew();
        introduction.unanswered(Query::Limits, true, NOW);
        assert!(introduction.holds(Query::Limits), "the tries are counted anew");
    }
}
