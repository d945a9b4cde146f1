// SPDX-License-Identifier: MPL-2.0

/// The zoom in steps of the lens, as users count it and some cameras do: from 1, zoomed out, to 9999. Beyond lies digital zoom.
#[derive(Debug, Clone, Copy, PartialEq, PartialOrd)]
pub struct ZoomStep(pub f64);

impl ZoomStep {
    /// Zoomed out.
    pub const FIRST: Self = Self(1.0);
    /// The end of the optical zoom.
    pub const LAST: Self = Self(9999.0);

    /// The step that a part of the zoom's travel is, to a ten thousandth.
    pub fn at(travel: f64) -> Self {
        Self(((Self::FIRST.0 + travel * Self::travelled()) * 1e4).round() / 1e4)
    }

    /// The part of the zoom's travel that it is.
    pub fn travel(self) -> f64 {
        (self.0 - Self::FIRST.0) / Self::travelled()
    }

    /// The nearest whole step of the optical zoom.
    pub fn whole(self) -> u16 {
        // Within 1..=9999.
        self.0.clamp(Self::FIRST.0, Self::LAST.0).round() as u16
    }

    fn travelled() -> f64 {
        Self::LAST.0 - Self::FIRST.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_come_back() {
        for step in 1..=9999 {
            let there = ZoomStep(step.into());
            assert_eq!(ZoomStep::at(there.travel()), there);
            assert_eq!(there.whole(), step);
        }
        assert_eq!((ZoomStep::at(-1.0).whole(), ZoomStep::at(2.0).whole()), (1, 9999));
    }
}
