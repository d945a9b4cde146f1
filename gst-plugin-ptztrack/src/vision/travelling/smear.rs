// SPDX-License-Identifier: MPL-2.0

use std::time::Duration;

/// A picture that goes by more of its widths in a second is smeared. Whoever follows somebody who fills 0.4 of the height turns at a
/// quarter of that while they walk, and at two thirds while they run.
const FAST: f64 = 1.0;
/// No camera turns for longer from one place to another. Where nobody can tell how a picture moved after that, it is another one.
const LONGEST: Duration = Duration::from_secs(1);

/// Whether the camera turns so fast that its pictures are smeared. A background that was learned of them is not that of sharp ones: all
/// edges of the room would be foreground, for as long as it takes what stands to become background.
#[derive(Debug, Default)]
pub(super) struct Smear {
    /// For so long.
    lasts: Option<Duration>,
}

impl Smear {
    /// Takes by how many of its widths the next picture has gone, where that is known, else whether it shows another view.
    pub fn update(&mut self, gone: Option<f64>, shows_another_view: bool, elapsed: Duration) {
        let lasts = self.lasts.map(|lasts| lasts.saturating_add(elapsed));
        self.lasts = match gone {
            Some(gone) if gone > FAST * elapsed.as_secs_f64() => Some(Duration::ZERO),
            Some(_) => None,
            None if shows_another_view => Some(Duration::ZERO),
            None => lasts.filter(|lasts| *lasts < LONGEST),
        };
    }

    /// Whether the last picture was smeared.
    pub fn is_there(&self) -> bool {
        self.lasts.is_some()
    }
}
