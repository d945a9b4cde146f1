// SPDX-License-Identifier: MPL-2.0

use serde::{Deserialize, Serialize};

/// What somebody looks like from afar: how much of each colour there is at the top, in the middle and at the bottom.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Looks(Vec<u8>);

/// Head and shoulders, trunk, legs.
const BANDS: usize = 3;
/// Shades of each of red, green and blue.
const SHADES: usize = 4;
const COLOURS: usize = SHADES * SHADES * SHADES;

impl Looks {
    /// Of the pixels of somebody: red, green and blue, with how far down each is, 0 to 1.
    pub(crate) fn of(pixels: impl Iterator<Item = (f64, [u8; 3])>) -> Self {
        let mut counts = vec![0_u32; BANDS * COLOURS];
        for (down, colour) in pixels {
            let band = ((down * BANDS as f64) as usize).min(BANDS - 1);
            let shade = colour.map(|part| usize::from(part) * SHADES / 256);
            counts[band * COLOURS + (shade[0] * SHADES + shade[1]) * SHADES + shade[2]] += 1;
        }
        let share = |band: &[u32]| {
            let all = band.iter().sum::<u32>().max(1);
            band.iter().map(|count| (count * 255 / all) as u8).collect::<Vec<_>>()
        };
        Self(counts.chunks(COLOURS).flat_map(share).collect())
    }

    /// How much two look alike, 0 to 1 (Bhattacharyya's coefficient, on average over the parts).
    pub fn likeness(&self, other: &Self) -> f64 {
        let norm = |looks: &Self| looks.0.iter().map(|share| f64::from(*share)).sum::<f64>();
        let both: f64 =
            self.0.iter().zip(&other.0).map(|(a, b)| (f64::from(*a) * f64::from(*b)).sqrt()).sum();
        let all = (norm(self) * norm(other)).sqrt();
        if all > 0.0 { (both / all).min(1.0) } else { 0.0 }
    }

    /// As they are kept.
    pub(crate) fn bytes(&self) -> &[u8] {
        &self.0
    }
}

impl From<Vec<u8>> for Looks {
    fn from(bytes: Vec<u8>) -> Self {
        Self(bytes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const RED: [u8; 3] = [200, 30, 30];
    const BLUE: [u8; 3] = [30, 30, 200];

    fn dressed(coat: [u8; 3], trousers: [u8; 3]) -> Looks {
        Looks::of((0..300).map(|n| {
            let down = f64::from(n) / 300.0;
            (down, if down < 0.6 { coat } else { trousers })
        }))
    }

    #[test]
    fn who_wears_the_same_looks_the_same_and_who_wears_it_elsewhere_does_not() {
        let one = dressed(RED, BLUE);
        assert!(one.likeness(&dressed(RED, BLUE)) > 0.99);
        assert!(one.likeness(&dressed(BLUE, RED)) < 0.3);
        assert!(one.likeness(&dressed(RED, RED)) > one.likeness(&dressed(BLUE, RED)));
        assert_eq!(one.likeness(&Looks::default()), 0.0);
    }
}
