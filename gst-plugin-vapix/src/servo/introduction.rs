use std::collections::VecDeque;
use std::time::Duration;

use super::Query;

/// What is still to be asked of a camera just met.
#[derive(Debug)]
pub struct Introduction {
    /// Each with how often it went unanswered.
    pending: VecDeque<(Query, u32)>,
    next_at: Duration,
}

impl Default for Introduction {
    fn default() -> Self {
        let pending = Query::INTRODUCTION.into_iter().map(|query| (query, 0)).collect();
        Self { pending, next_at: Duration::ZERO }
    }
}

impl Introduction {
    /// What goes unanswered so often is not asked again.
    const TRIES: u32 = 3;

    /// From a question without an answer to the next: time to see whether the camera is there at all.
    const PAUSE: Duration = Duration::from_secs(1);

    /// What to ask next, and when.
    pub fn next(&self) -> Option<(Query, Duration)> {
        self.pending.front().map(|(query, _)| (*query, self.next_at))
    }

    /// Whether this is still to be asked.
    pub fn holds(&self, query: Query) -> bool {
        self.pending.iter().any(|(pending, _)| *pending == query)
    }

    /// Whether the camera was not asked yet where it looks and how far it can, without which it is not to be moved.
    pub fn comes_first(&self) -> bool {
        let vital = |query: Query| matches!(query, Query::Position | Query::Limits);
        self.pending.iter().any(|(query, unanswered)| vital(*query) && *unanswered == 0)
    }

    /// This is to be asked before all else.
    pub fn ask_first(&mut self, query: Query) {
        self.pending.retain(|(pending, _)| *pending != query);
        self.pending.push_front((query, 0));
    }

    /// This need not be asked again. Returns whether it was the last.
    pub fn done(&mut self, query: Query) -> bool {
        let before = self.pending.len();
        self.pending.retain(|(pending, _)| *pending != query);
        before > 0 && self.pending.is_empty()
    }

    /// This went unanswered: it is asked again after the others, if it is worth it. `counts`: as one of the tries.
    /// Returns whether nothing is left to ask.
    pub fn unanswered(&mut self, query: Query, counts: bool, now: Duration) -> bool {
        self.next_at = now + Self::PAUSE;
        let Some(index) = self.pending.iter().position(|(pending, _)| *pending == query) else {
            return false;
        };
        let tries = self.pending[index].1 + u32::from(counts);
        let last = self.done(query);
        if tries >= Self::TRIES {
            return last;
        }
        self.pending.push_back((query, tries));
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
}
