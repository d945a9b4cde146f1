// SPDX-License-Identifier: MPL-2.0

//! Whether the target is still there: doubt that grows with time, not one bad picture.

/// Seconds in which nothing of the target to be seen turns certainty into doubt.
const DOUBT_TIME_S: f32 = 0.25;
/// Share of what is usually seen of the target that speaks neither for nor against it.
const EVEN: f32 = 0.45;

/// A sequential test (after Wald) between "here" and "hidden or elsewhere", from 1 (sure that it is here) to -1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Presence(f32);

impl Default for Presence {
    /// The target was just seen.
    fn default() -> Self {
        Self(1.0)
    }
}

impl Presence {
    /// Takes what was seen in a picture, as a share of what is usually seen of the target.
    pub fn update(&mut self, seen: f32, dt_s: f32) {
        let speaks = ((seen - EVEN) / EVEN).clamp(-1.0, 1.0);
        self.0 = (self.0 + speaks * dt_s / DOUBT_TIME_S).clamp(-1.0, 1.0);
    }

    /// Whether it is likelier here than not.
    pub fn is_here(self) -> bool {
        self.0 > 0.0
    }

    /// 0 to 1: how sure.
    pub fn confidence(self) -> f32 {
        self.0.max(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn after(pictures: usize, seen: impl Fn(usize) -> f32) -> Presence {
        let mut presence = Presence::default();
        (0..pictures).for_each(|picture| presence.update(seen(picture), 0.04));
        presence
    }

    #[test]
    fn one_bad_picture_is_no_loss_and_half_a_second_of_wall_is() {
        assert!(after(50, |picture| if picture == 25 { 0.0 } else { 1.0 }).is_here());
        assert!(!after(13, |_| 0.0).is_here());
    }

    #[test]
    fn flicker_between_good_and_bad_does_not_hide_it() {
        assert!(after(200, |picture| if picture % 2 == 0 { 0.1 } else { 0.9 }).is_here());
    }
}
