// SPDX-License-Identifier: MPL-2.0

//! The light that a photograph of all around throws on somebody in it.

use super::equirectangular::Equirectangular;
use crate::world::room::{light::Irradiance, view::Vector};

/// Directions that are looked at, across and up.
const GRID: (usize, usize) = (96, 48);
/// How much brighter a face to the brightest side may be than the mean of all sides, at most.
const CONTRAST: f64 = 1.7;

/// The light on surfaces of all directions, as bright as `level` on the average of upright ones, and the tint that it has: both
/// chroma values of a mid-grey thing less 128.
pub(super) fn surroundings(panorama: &Equirectangular, level: f64) -> (Irradiance, [f64; 2]) {
    let mut light = Irradiance::default();
    let (mut tint, mut weight) = ([0.0; 2], 0.0);
    for index in 0..GRID.0 * GRID.1 {
        let across = ((index % GRID.0) as f64 + 0.5) / GRID.0 as f64;
        let down = ((index / GRID.0) as f64 + 0.5) / GRID.1 as f64;
        let (yaw, pitch) = ((across - 0.5) * std::f64::consts::TAU, (0.5 - down) * std::f64::consts::PI);
        let direction: Vector = [pitch.cos() * yaw.sin(), pitch.sin(), pitch.cos() * yaw.cos()];
        let [luma, u, v] = panorama.mean_at(across, down);
        // Bright places are brighter than film tells.
        let bright = ((luma - 16.0) / 219.0).max(0.0).powi(2);
        let area = pitch.cos();
        light.add(direction, bright * area);
        tint = [tint[0] + (u - 128.0) * bright * area, tint[1] + (v - 128.0) * bright * area];
        weight += bright * area;
    }
    // Film takes out a part of the tint, and half of what is left are the colours of things.
    let share = 0.4 / weight.max(1e-9);
    (light.levelled(level, CONTRAST), tint.map(|sum| sum * share))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_stands_in_even_light_is_lit_evenly_and_a_bright_side_lights_its_side() {
        let even = Equirectangular::painted(|_, _| [120, 140, 120]);
        let (light, tint) = surroundings(&even, 0.8);
        for normal in [[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [-1.0, 0.0, 0.0]] {
            assert!((light.at(normal) - 0.8).abs() < 0.02, "{}", light.at(normal));
        }
        assert!(tint[0] > 3.0 && tint[1] < -1.0, "{tint:?}");
        // The window is to the right.
        let aside = Equirectangular::painted(|yaw, _| {
            [if (60.0..120.0).contains(&yaw) { 230 } else { 60 }, 128, 128]
        });
        let (light, _) = surroundings(&aside, 0.8);
        assert!(light.at([1.0, 0.0, 0.0]) > 1.3 * light.at([-1.0, 0.0, 0.0]));
        assert!(light.at([1.0, 0.0, 0.0]) < 0.8 * CONTRAST + 0.05);
    }
}
