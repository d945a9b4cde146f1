// SPDX-License-Identifier: MPL-2.0

//! What covers the person: skin, hair and clothes, with their patterns, folds and weave, as tiles of cloth.

use super::{
    super::settings::Subject,
    pattern::Pattern,
    wardrobe::{Attire, Rgb},
};
use crate::seeded::Seeded;

/// Which cloth a patch of skin is of: indices into [`Outfit::cloths`].
pub(crate) const SKIN: usize = 0;
pub(crate) const FACE: usize = 1;
pub(crate) const HAIR: usize = 2;
pub(crate) const SHIRT: usize = 3;
pub(crate) const TROUSERS: usize = 4;
pub(crate) const SHOES: usize = 5;

/// Length of a tile's side, in metres.
pub(crate) const TILE: f64 = 0.5;
/// Texels along it: about a millimetre each where there is something to see, two where not.
const FINE: usize = 512;
const COARSE: usize = 256;
const LEVELS: usize = 5;

/// Brightness and tints: Y, U, V in video range.
pub(crate) type Colour = [f64; 3];

/// Red, green and blue of a screen (0 to 255) as BT.601 video has them.
pub(crate) fn rgb(red: f64, green: f64, blue: f64) -> Colour {
    let luma = 0.299 * red + 0.587 * green + 0.114 * blue;
    [16.0 + luma * 219.0 / 255.0, 128.0 + (blue - luma) * 0.496, 128.0 + (red - luma) * 0.627]
}

/// A tile of cloth, each level half as fine as the one before.
#[derive(Debug, Clone)]
pub(crate) struct Cloth {
    /// Texels along a side at the finest level.
    side: usize,
    levels: Vec<Vec<[u8; 4]>>,
    /// How strongly the threads show close up.
    pub weave: f32,
}

impl Cloth {
    /// A tile painted by a function of the place in it, both coordinates from 0 to 1.
    pub fn painted(side: usize, weave: f32, paint: impl Fn(f64, f64) -> Colour) -> Self {
        let at = |index: usize| (index as f64 + 0.5) / side as f64;
        let byte = |value: f64| (value + 0.5).clamp(1.0, 254.0) as u8;
        let finest: Vec<[u8; 4]> = (0..side * side)
            .map(|index| {
                let [y, u, v] = paint(at(index % side), at(index / side)).map(byte);
                [y, u, v, 0]
            })
            .collect();
        let mut levels = vec![finest];
        for level in 1..LEVELS {
            let side = side >> level;
            let before = &levels[level - 1];
            let halved = (0..side * side)
                .map(|index| {
                    let corner = index / side * 2 * side * 2 + index % side * 2;
                    let four = [corner, corner + 1, corner + 2 * side, corner + 2 * side + 1];
                    let mean = |part: usize| {
                        let sum: u32 = four.iter().map(|&texel| u32::from(before[texel][part])).sum();
                        ((sum + 2) / 4) as u8
                    };
                    [mean(0), mean(1), mean(2), 0]
                })
                .collect();
            levels.push(halved);
        }
        Self { side, levels, weave }
    }

    /// The same in light of a tint: both chroma values of grey less 128. Dark cloth takes less of it.
    fn tinted(mut self, tint: [f64; 2]) -> Self {
        for [y, u, v, _] in self.levels.iter_mut().flatten() {
            let part = (f64::from(*y) - 16.0) / 110.0;
            let moved = |value: u8, by: f64| (f64::from(value) + by * part).clamp(1.0, 254.0) as u8;
            (*u, *v) = (moved(*u, tint[0]), moved(*v, tint[1]));
        }
        self
    }

    /// The level whose texels are about as wide as a sample, its texels a row and its texels a metre.
    pub fn level(&self, samples_per_metre: f64) -> (&[[u8; 4]], usize, f64) {
        let finer = self.side as f64 / TILE / samples_per_metre.max(1.0);
        let level = (finer.log2().round().max(0.0) as usize).min(LEVELS - 1);
        let side = self.side >> level;
        (&self.levels[level], side, side as f64 / TILE)
    }
}

/// All that covers a person, and how it sits.
#[derive(Debug, Clone)]
pub(crate) struct Outfit {
    pub cloths: [Cloth; 6],
    /// Width of the upper garment over the body's.
    pub looseness: f64,
    pub trouser_width: f64,
    pub short_sleeves: bool,
    pub long_hair: bool,
    /// In body heights.
    pub hair_volume: f64,
}

impl Outfit {
    /// Somebody of the subject's kind, in a room whose wall has this colour.
    pub fn of(subject: Subject, wall: Rgb, chance: &mut Seeded) -> Self {
        let skin =
            chance.pick(&[rgb(224.0, 178.0, 150.0), rgb(198.0, 146.0, 116.0), rgb(150.0, 104.0, 80.0)]);
        let hair = chance.pick(&[rgb(38.0, 28.0, 24.0), rgb(84.0, 58.0, 38.0), rgb(22.0, 21.0, 23.0)]);
        let kind = Attire::of(subject, wall, chance);
        let mut noise = Pattern::new(chance.bits());
        let fold_seed = chance.unit();
        let worn = |colour: Colour, shade: f64| [16.0 + (colour[0] - 16.0) * shade, colour[1], colour[2]];
        let skin_cloth =
            Cloth::painted(COARSE, 0.02, |u, v| worn(skin, 0.97 + 0.06 * noise.smooth(u, v, 24)));
        let hair_cloth = Cloth::painted(COARSE, 0.05, |u, v| worn(hair, hair_shade(&noise, u, v)));
        let long_hair = subject == Subject::B;
        let face_cloth = Cloth::painted(FINE, 0.03, |u, v| {
            let hair = worn(hair, hair_shade(&noise, u, v));
            let strand = noise.stretched(u, v, 128, 40) - 0.5;
            mix(&face(skin, u, v), &hair, grown(u, v, long_hair, strand))
        });
        let shirt = Cloth::painted(FINE, 0.10, |u, v| {
            worn(kind.shirt.colour(u, v, &noise), folds(&noise, u, v, fold_seed, kind.shirt_folds))
        });
        let trousers = Cloth::painted(FINE, 0.14, |u, v| {
            let faded = 0.10 * (noise.smooth(u, v, 6) - 0.5) + 0.12 * (noise.smooth(u, v, 128) - 0.5);
            worn(kind.trousers, folds(&noise, u, v, fold_seed + 0.4, 0.20) + faded)
        });
        let shoes = Cloth::painted(COARSE, 0.03, |u, v| {
            // The sole below, laces across the instep.
            let laced = (u - 0.28).abs() < 0.06 && (0.2..0.36).contains(&v) && (v * 40.0).fract() < 0.4;
            let below = (u - 0.28).abs() > 0.17;
            if laced || below { worn(kind.sole, 0.8) } else { kind.shoes }
        });
        noise = Pattern::new(chance.bits());
        let long = noise.smooth(0.1, 0.1, 4);
        Self {
            cloths: [skin_cloth, face_cloth, hair_cloth, shirt, trousers, shoes],
            looseness: kind.looseness,
            trouser_width: kind.trouser_width,
            short_sleeves: kind.short_sleeves,
            long_hair,
            hair_volume: 0.004 + 0.004 * long,
        }
    }
}

impl Outfit {
    /// The same in light of a tint: both chroma values of grey less 128.
    pub fn tinted(self, tint: [f64; 2]) -> Self {
        Self { cloths: self.cloths.map(|cloth| cloth.tinted(tint)), ..self }
    }
}

pub(super) fn mix(one: &Colour, other: &Colour, share: f64) -> Colour {
    [0, 1, 2].map(|part| one[part] + (other[part] - one[part]) * share)
}

/// How light cloth is on and between its folds, 1 where it lies smooth.
fn folds(noise: &Pattern, u: f64, v: f64, offset: f64, depth: f64) -> f64 {
    let (u, v) = (u + offset, v + 2.0 * offset);
    // Creases run slanting, and across where a joint bends.
    let slanting = noise.stretched(u + v, v, 4, 9) + noise.stretched(u - v, v, 3, 7);
    let across = noise.stretched(u, v, 3, 16);
    let fold = 0.35 * slanting + 0.3 * across - 0.5;
    1.0 + depth * (2.2 * fold).clamp(-1.0, 0.7)
}

fn hair_shade(noise: &Pattern, u: f64, v: f64) -> f64 {
    0.6 + 0.8 * noise.stretched(u, v, 120, 8) + 0.25 * noise.smooth(u, v, 8)
}

/// How much of a head is hair at a place of [`face`]'s tile, from 0 to 1; `strand` makes its edge uneven.
fn grown(u: f64, v: f64, long: bool, strand: f64) -> f64 {
    let side = (u - 0.5).abs();
    let temple = if long { 0.17 } else { 0.22 } - 0.3 * (v - 0.6).max(0.0);
    // Below the ears it goes back, to the nape, unless it is long.
    let cheek = if long { 0.02 } else { 0.14 } * ((0.5 - v) / 0.2).clamp(0.0, 1.0);
    let beside = side - temple - cheek;
    let above = v - 0.80 + 1.2 * side * side;
    let below = if long { 1.0 } else { v - 0.1 };
    ((beside.max(above).min(below) + 0.03 * strand) / 0.012 + 0.5).clamp(0.0, 1.0)
}

/// A face round the front of a head: `u` from the back over 0.5 in front to the back, `v` from chin to crown.
fn face(skin: Colour, u: f64, v: f64) -> Colour {
    let side = (u - 0.5).abs();
    let near = |x: f64, y: f64, wide: f64, high: f64| {
        let (across, along) = ((side - x) / wide, (v - y) / high);
        (-(across * across + along * along)).exp()
    };
    let dark = 0.75 * near(0.075, 0.52, 0.022, 0.016) // eyes
        + 0.30 * near(0.075, 0.55, 0.045, 0.05) // sockets
        + 0.55 * near(0.078, 0.625, 0.05, 0.016) // brows
        + 0.30 * near(0.0, 0.335, 0.035, 0.02) // below the nose
        + 0.35 * near(0.0, 0.215, 0.06, 0.018) // mouth
        + 0.12 * near(0.0, 0.12, 0.07, 0.03) // below the lip
        + 0.15 * near(0.15, 0.3, 0.06, 0.16); // below the cheekbones
    let red = 14.0 * near(0.0, 0.21, 0.055, 0.025) + 5.0 * near(0.1, 0.36, 0.05, 0.08);
    let light = 1.0 - dark.min(0.85) + 0.06 * near(0.06, 0.42, 0.05, 0.06);
    [16.0 + (skin[0] - 16.0) * light, skin[1] - red * 0.2, skin[2] + red * (1.0 - 0.5 * dark)]
}
