// SPDX-License-Identifier: MPL-2.0

/// Whether a camera was moved: a cumulative sum (Page, Continuous inspection schemes, 1954) of what each person's way says.
///
/// Of a camera that stays most people bear the map out, but not all: two may be confused. Of one that was moved nobody does.
#[derive(Debug, Clone, Default)]
pub struct MovedDetector {
    evidence: f64,
    person: u64,
    /// Pairs of this person that bear the map out, and that contradict it.
    pairs: [u32; 2],
}

impl MovedDetector {
    /// So many people in a hundred are confused with others ...
    const CONFUSED: f64 = 0.3;
    /// ... and so many contradict the map of a camera that was moved.
    const CONTRADICT: f64 = 0.9;
    /// The logarithm of how much likelier that it was moved has to be: 100 times.
    const CERTAIN: f64 = 4.6;
    /// Of fewer pairs nothing is concluded.
    const LEAST_PAIRS: u32 = 5;

    /// Takes a pair; returns whether the camera was moved, by all there is.
    pub fn see(&mut self, person: u64, contradicts: bool) -> bool {
        if person != self.person {
            self.conclude();
            self.person = person;
        }
        self.pairs[usize::from(contradicts)] += 1;
        self.evidence > Self::CERTAIN
    }

    fn conclude(&mut self) {
        let [bear_out, contradict] = std::mem::take(&mut self.pairs);
        if bear_out + contradict < Self::LEAST_PAIRS {
            return;
        }
        let step = if contradict > bear_out {
            (Self::CONTRADICT / Self::CONFUSED).ln()
        } else {
            ((1.0 - Self::CONTRADICT) / (1.0 - Self::CONFUSED)).ln()
        };
        self.evidence = (self.evidence + step).max(0.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn people(contradict: impl Fn(u64) -> bool) -> Option<u64> {
        let mut moved = MovedDetector::default();
        (1..1000).find(|person| (0..10).any(|_| moved.see(*person, contradict(*person))))
    }

    #[test]
    fn a_few_who_contradict_are_confused_and_all_who_do_say_that_it_was_moved() {
        assert_eq!(people(|person| person % 3 == 0), None);
        assert_eq!(people(|_| true), Some(6));
        assert_eq!(people(|person| person >= 500), Some(505));
    }

    #[test]
    fn one_person_alone_says_nothing_however_long() {
        let mut moved = MovedDetector::default();
        assert!((0..10_000).all(|_| !moved.see(1, true)));
    }
}
