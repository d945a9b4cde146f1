// SPDX-License-Identifier: MPL-2.0

//! What people put on: cuts, patterns and colours. Half of them wear plain clothes, many of these dark.

use super::{
    super::settings::Subject,
    clothes::{Colour, mix, rgb},
    pattern::Pattern,
};
use crate::seeded::Seeded;

/// Red, green and blue, 0 to 1.
pub(crate) type Rgb = [f32; 3];

/// How many wear plain clothes, and how many of these dark ones.
const PLAIN: f64 = 0.5;
const DARK: f64 = 0.6;

/// Black, charcoal, navy, brown, bottle green, burgundy.
const DARKS: [[f64; 3]; 6] = [
    [30.0, 29.0, 32.0],
    [52.0, 52.0, 55.0],
    [30.0, 36.0, 62.0],
    [58.0, 42.0, 33.0],
    [30.0, 50.0, 40.0],
    [66.0, 28.0, 36.0],
];
/// Grey, olive, denim, beige, white, red, blue, yellow, rose.
const OTHERS: [[f64; 3]; 9] = [
    [128.0, 128.0, 126.0],
    [104.0, 104.0, 72.0],
    [84.0, 104.0, 140.0],
    [188.0, 170.0, 140.0],
    [226.0, 224.0, 218.0],
    [170.0, 48.0, 46.0],
    [44.0, 92.0, 156.0],
    [222.0, 190.0, 88.0],
    [208.0, 146.0, 160.0],
];

/// The clothes of one person and how they sit.
pub(super) struct Attire {
    pub shirt: Shirt,
    pub shirt_folds: f64,
    pub trousers: Colour,
    pub shoes: Colour,
    pub sole: Colour,
    /// Width of the upper garment over the body's.
    pub looseness: f64,
    pub trouser_width: f64,
    pub short_sleeves: bool,
}

impl Attire {
    /// Clothes of the subject's kind. Subject A wears about the colour of the wall.
    pub fn of(subject: Subject, wall: Rgb, chance: &mut Seeded) -> Self {
        let plain = chance.unit() < PLAIN;
        let dark = chance.unit() < DARK;
        let (shirt, trousers) = match subject {
            Subject::A => near(wall, chance),
            Subject::B | Subject::C => {
                let shirt = chance.pick(if plain && dark { &DARKS } else { &OTHERS });
                (shirt, chance.pick(if dark { &DARKS } else { &OTHERS }))
            }
        };
        let (looseness, trouser_width) = match subject {
            Subject::A => (1.07, 1.16),
            Subject::B => (1.03, 1.0),
            Subject::C => (1.12, 1.22),
        };
        let contrast = if subject == Subject::A { 0.16 } else { chance.range(0.3, 0.8) };
        let [shoes, sole] = [&DARKS[..], &OTHERS[..]].map(|colours| of(chance.pick(colours)));
        Self {
            shirt: Shirt::of(plain, shirt, contrast, chance),
            shirt_folds: chance.range(0.16, 0.24),
            trousers: of(trousers),
            shoes,
            sole,
            looseness,
            trouser_width,
            short_sleeves: chance.unit() < 0.3,
        }
    }
}

/// Shirt and trousers a little lighter and darker than a wall.
fn near(wall: Rgb, chance: &mut Seeded) -> ([f64; 3], [f64; 3]) {
    let mut toned = |low: f64, high: f64| {
        let tone = chance.range(low, high);
        wall.map(|part| (255.0 * f64::from(part) * tone).min(250.0))
    };
    (toned(0.88, 1.04), toned(0.72, 0.92))
}

fn of([red, green, blue]: [f64; 3]) -> Colour {
    rgb(red, green, blue)
}

/// The stuff of a shirt.
pub(super) struct Shirt {
    cut: Cut,
    /// The ground, and what the pattern is of.
    colours: [Colour; 3],
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Cut {
    Plain,
    Stripes,
    Check,
    Print,
}

impl Shirt {
    fn of(plain: bool, ground: [f64; 3], contrast: f64, chance: &mut Seeded) -> Self {
        let cut = if plain { Cut::Plain } else { chance.pick(&[Cut::Stripes, Cut::Check, Cut::Print]) };
        let towards = |end: f64, share: f64| of(ground.map(|part| part + (end - part) * share));
        let light = ground.iter().sum::<f64>() > 330.0;
        let (one, other) = if light { (20.0, 250.0) } else { (245.0, 20.0) };
        // Even plain cloth is dyed unevenly.
        let share = if plain { 0.04 } else { contrast };
        Self { cut, colours: [of(ground), towards(one, share), towards(other, 0.6 * share)] }
    }

    /// At a place of its tile, both coordinates from 0 to 1.
    pub fn colour(&self, u: f64, v: f64, noise: &Pattern) -> Colour {
        let [ground, second, third] = &self.colours;
        match self.cut {
            Cut::Plain => mix(ground, second, noise.smooth(u, v, 96)),
            Cut::Stripes => *if (v * 14.0).fract() < 0.42 { second } else { ground },
            Cut::Check => {
                let band = |place: f64| (place * 7.0).fract() < 0.5;
                let line = |place: f64| ((place * 7.0 + 0.25).fract() - 0.5).abs() < 0.045;
                let crossed = f64::from(u8::from(band(u))) * 0.5 + f64::from(u8::from(band(v))) * 0.5;
                let woven = mix(ground, second, crossed);
                if line(u) || line(v) { mix(&woven, third, 0.75) } else { woven }
            }
            Cut::Print => {
                let leaf = noise.smooth(u, v, 14);
                let vein = noise.smooth(v, u, 22);
                if leaf > 0.62 {
                    *third
                } else if vein > 0.6 {
                    *second
                } else {
                    *ground
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WALL: Rgb = [0.8, 0.76, 0.7];

    fn people(subject: Subject) -> impl Iterator<Item = Attire> {
        (0..400).map(move |seed| Attire::of(subject, WALL, &mut Seeded::new(seed)))
    }

    #[test]
    fn half_of_the_people_are_plainly_clothed_and_many_of_these_darkly() {
        for subject in [Subject::A, Subject::B, Subject::C] {
            let plain: Vec<_> = people(subject).filter(|attire| attire.shirt.cut == Cut::Plain).collect();
            assert!((160..240).contains(&plain.len()), "{subject:?}: {}", plain.len());
            if subject != Subject::A {
                let dark = plain.iter().filter(|attire| attire.shirt.colours[0][0] < 70.0).count();
                assert!(dark * 10 > plain.len() * 4, "{subject:?}: {dark} of {}", plain.len());
            }
        }
    }

    #[test]
    fn subject_a_wears_about_the_colour_of_the_wall() {
        let [y, u, v] = of(WALL.map(|part| 255.0 * f64::from(part)));
        for attire in people(Subject::A) {
            let [ground, ..] = attire.shirt.colours;
            assert!(
                (ground[0] - y).abs() < 30.0 && (ground[1] - u).abs() < 6.0 && (ground[2] - v).abs() < 6.0
            );
        }
    }
}
