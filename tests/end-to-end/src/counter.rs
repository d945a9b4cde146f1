// SPDX-License-Identifier: MPL-2.0

/// What programs, or cameras of one that begin anew, count one after the other, as one number.
#[derive(Debug, Default)]
pub struct Counter {
    /// By those before.
    before: u64,
    now: u64,
}

impl Counter {
    /// So much is counted now. Where that is less than before, somebody has begun anew.
    pub fn is(&mut self, count: u64) {
        if self.is_more_than(count) {
            self.begin_anew();
        }
        self.now = count;
    }

    /// Whether so much is less than was counted before.
    pub fn is_more_than(&self, count: u64) -> bool {
        count < self.now
    }

    /// What is counted next begins at nought, which cannot always be told by what it is.
    pub fn begin_anew(&mut self) {
        self.before += std::mem::take(&mut self.now);
    }

    /// At least so much was counted: what came between a look and a new beginning is not in it.
    pub fn total(&self) -> u64 {
        self.before + self.now
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_counted_before_a_new_beginning_counts_too() {
        let mut counter = Counter::default();
        [1, 3, 3, 7, 1, 2].into_iter().for_each(|count| counter.is(count));
        assert_eq!(counter.total(), 9);
    }
}
