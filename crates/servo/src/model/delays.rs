// SPDX-License-Identifier: MPL-2.0

use crate::Time;

use std::time::Duration;

/// How late everything is.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Delays {
    /// From sending a command to the camera's motion.
    pub command: Duration,
    /// From light on the sensor to the picture's timestamp, as it is taken here.
    pub video: Duration,
    /// By how much their sum may be wrong.
    pub uncertainty: Duration,
}

impl Delays {
    /// Of which only the sum is known, as a picture shows it: half of it is taken to be the command's.
    pub fn of_sum(sum: Duration, uncertainty: Duration) -> Self {
        let command = sum / 2;
        Self { command, video: sum - command, uncertainty }
    }

    /// From sending a command to the timestamp of the first picture that shows it.
    pub fn sum(&self) -> Duration {
        self.command + self.video
    }

    /// When what a picture shows was sent, at the latest.
    pub fn sent_by(&self, taken_at: Time) -> Time {
        taken_at - self.sum()
    }
}
