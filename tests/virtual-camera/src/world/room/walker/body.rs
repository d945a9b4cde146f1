// SPDX-License-Identifier: MPL-2.0

//! The skin of a posed body: which rings lie round which bones.

use super::{
    super::view::{Vector, add, cross, dot, scale, subtract},
    clothes::{FACE, HAIR, Outfit, SHIRT, SHOES, SKIN, TILE, TROUSERS},
    figure::{Build, Frame},
    gait::{Arm, BodyPose, Leg},
    mesh::{Detail, Ring, SkinPatch, egg, skin},
};

/// All of the body's skin.
pub(crate) fn patches(pose: &BodyPose, build: &Build, outfit: &Outfit, detail: Detail) -> Vec<SkinPatch> {
    let size = build.height;
    let mut patches = vec![
        skin(&trunk(pose, build, &PELVIS, 1.0), TROUSERS, [0.1, 0.0], detail),
        skin(&trunk(pose, build, &TORSO, outfit.looseness), SHIRT, [0.0, 0.0], detail),
        skin(&neck(pose, build), SKIN, [0.0, 0.0], detail),
    ];
    for (side, leg) in pose.legs.iter().enumerate() {
        let offset = 0.3 * side as f64;
        patches.push(skin(&trouser_leg(pose, leg, build, outfit), TROUSERS, [offset, 0.1], detail));
        patches.push(skin(&shoe(leg, size), SHOES, [0.0, 0.0], detail));
    }
    for (side, arm) in pose.arms.iter().enumerate() {
        let offset = 0.2 + 0.25 * side as f64;
        let sleeve = sleeve(pose, arm, build, outfit);
        patches.push(skin(&sleeve, SHIRT, [offset, 0.05], detail));
        if outfit.short_sleeves {
            patches.push(skin(&bare_arm(arm, build), SKIN, [offset, 0.0], detail));
        }
        patches.push(skin(&hand(arm, build, side), SKIN, [offset, 0.1], detail));
        patches.push(skin(&thumb(arm, size, side), SKIN, [offset, 0.1], detail));
    }
    head(pose, build, outfit, detail, &mut patches);
    patches
}

/// Cross-sections of the trunk: height over the pelvis, half width, half depth, how far ahead, light; in body heights.
const TORSO: [[f64; 5]; 10] = [
    [-0.004, 0.096, 0.075, -0.006, 0.85],
    [0.018, 0.094, 0.072, -0.005, 0.95],
    [0.05, 0.090, 0.066, 0.0, 1.0],
    [0.11, 0.090, 0.066, 0.002, 0.95],
    [0.17, 0.098, 0.070, 0.004, 0.93],
    [0.225, 0.107, 0.070, 0.0, 0.95],
    [0.262, 0.112, 0.060, -0.006, 1.0],
    [0.286, 0.092, 0.049, -0.008, 1.0],
    [0.303, 0.060, 0.042, -0.006, 0.95],
    [0.316, 0.037, 0.037, -0.002, 0.8],
];
const PELVIS: [[f64; 5]; 6] = [
    [0.04, 0.080, 0.060, 0.0, 0.8],
    [0.0, 0.092, 0.066, -0.004, 0.85],
    [-0.035, 0.092, 0.064, -0.008, 0.9],
    [-0.060, 0.074, 0.054, -0.006, 0.8],
    [-0.076, 0.036, 0.034, -0.002, 0.7],
    [-0.080, 0.0, 0.0, 0.0, 0.6],
];

fn trunk(pose: &BodyPose, build: &Build, sections: &[[f64; 5]], looseness: f64) -> Vec<Ring> {
    let size = build.height;
    let ring = |&[height, width, depth, ahead, open]: &[f64; 5]| {
        let frame = pose.hips.towards(&pose.chest, (height / 0.2).clamp(0.0, 1.0));
        let spread = if height > 0.15 && height < 0.3 { build.breadth } else { 1.0 };
        // The collar does not grow with the waist.
        let girth = if height > 0.3 { 1.0 } else { build.girth };
        let loose = if height > 0.3 { 1.0 } else { looseness };
        Ring {
            centre: frame.place(pose.pelvis, [0.0, height * size, ahead * size]),
            right: scale(frame.right, width * size * spread * girth.sqrt() * loose),
            ahead: scale(frame.ahead, depth * size * girth * loose),
            open,
        }
    };
    sections.iter().map(ring).collect()
}

fn neck(pose: &BodyPose, build: &Build) -> [Ring; 3] {
    let size = build.height;
    let low = pose.chest.place(pose.pelvis, [0.0, 0.315 * size, 0.0]);
    let high = skull(pose, build);
    let ring = |share: f64, open| Ring {
        centre: add(low, scale(subtract(high, low), share)),
        right: scale(pose.head.right, 0.031 * size * build.girth.sqrt()),
        ahead: scale(pose.head.ahead, 0.032 * size * build.girth.sqrt()),
        open,
    };
    [ring(-0.1, 0.8), ring(0.4, 0.75), ring(0.95, 0.7)]
}

/// Where the skull sits on the neck.
fn skull(pose: &BodyPose, build: &Build) -> Vector {
    let top = pose.chest.place(pose.pelvis, [0.0, 0.348 * build.height, 0.006 * build.height]);
    pose.head.place(top, [0.0, 0.012 * build.height, 0.0])
}

/// Round two bones and their joint: half the thickness to the side and ahead at places along them (0 to 1, 1 to 2).
fn limb(
    [from, joint, to]: [Vector; 3],
    right: Vector,
    sections: &[[f64; 4]],
    thickness: f64,
    ends: f64,
) -> Vec<Ring> {
    let bones = [subtract(joint, from), subtract(to, joint)];
    let ring = |&[place, side, depth, open]: &[f64; 4]| {
        let (centre, share) = if place < 1.0 {
            (add(from, scale(bones[0], place)), ((place - 0.75) / 0.5).clamp(0.0, 1.0))
        } else {
            (add(joint, scale(bones[1], (place - 1.0) * ends)), ((place - 0.75) / 0.5).clamp(0.0, 1.0))
        };
        let along = add(scale(unit(bones[0]), 1.0 - share), scale(unit(bones[1]), share));
        let along = unit(along);
        let side_way = unit(subtract(right, scale(along, dot(right, along))));
        let ahead = cross(side_way, scale(along, -1.0));
        Ring {
            centre,
            right: scale(side_way, side * thickness),
            ahead: scale(unit(ahead), depth * thickness),
            open,
        }
    };
    sections.iter().map(ring).collect()
}

fn unit(vector: Vector) -> Vector {
    scale(vector, 1.0 / dot(vector, vector).sqrt().max(1e-9))
}

fn trouser_leg(pose: &BodyPose, leg: &Leg, build: &Build, outfit: &Outfit) -> Vec<Ring> {
    let width = outfit.trouser_width;
    let sections = [
        [-0.04, 0.034, 0.044, 0.8],
        [0.1, 0.047, 0.057, 0.85],
        [0.35, 0.048, 0.054, 0.85],
        [0.7, 0.040, 0.044, 0.9],
        [0.95, 0.034, 0.039, 0.95],
        [1.08, 0.033, 0.037, 0.95],
        [1.35, 0.033 * width, 0.038 * width, 0.9],
        [1.7, 0.028 * width, 0.032 * width, 0.9],
        [1.93, 0.027 * width, 0.031 * width, 0.8],
        [2.02, 0.027 * width, 0.032 * width, 0.7],
    ];
    let right = add(scale(pose.hips.right, 0.6), scale(leg.foot.right, 0.4));
    limb([leg.hip, leg.knee, leg.ankle], right, &sections, build.height * build.girth.sqrt(), 1.0)
}

fn shoe(leg: &Leg, size: f64) -> Vec<Ring> {
    // From heel to toe: place ahead of the ankle, half width, half height, all in body heights; the sole stays flat.
    let sections = [
        [-0.043, 0.0, 0.0],
        [-0.040, 0.014, 0.016],
        [-0.022, 0.020, 0.026],
        [0.005, 0.021, 0.030],
        [0.035, 0.023, 0.025],
        [0.068, 0.026, 0.019],
        [0.095, 0.023, 0.016],
        [0.107, 0.015, 0.012],
        [0.112, 0.0, 0.005],
    ];
    let sole = -0.047 * size;
    let ring = |[ahead, width, height]: [f64; 3]| Ring {
        centre: leg.foot.place(leg.ankle, [0.0, sole + height * size, ahead * size]),
        right: scale(leg.foot.right, width * size),
        ahead: scale(leg.foot.up, height * size),
        open: 0.85,
    };
    sections.map(ring).to_vec()
}

fn sleeve(pose: &BodyPose, arm: &Arm, build: &Build, outfit: &Outfit) -> Vec<Ring> {
    let wide = outfit.looseness;
    let mut sections = vec![
        [-0.10, 0.0, 0.0, 1.0],
        [-0.08, 0.014, 0.018, 1.0],
        [-0.02, 0.025, 0.029, 1.0],
        [0.08, 0.030, 0.034, 1.0],
        [0.28, 0.029 * wide, 0.033 * wide, 0.95],
    ];
    if outfit.short_sleeves {
        sections.extend([[0.45, 0.031, 0.033, 0.9], [0.62, 0.033, 0.034, 0.8]]);
    } else {
        sections.extend([
            [0.6, 0.026 * wide, 0.028 * wide, 0.9],
            [0.95, 0.024 * wide, 0.026 * wide, 0.9],
            [1.15, 0.024 * wide, 0.026 * wide, 0.92],
            [1.6, 0.021 * wide, 0.021 * wide, 0.95],
            [1.97, 0.017 * wide, 0.018 * wide, 0.9],
        ]);
    }
    let right = add(scale(pose.chest.right, 0.5), scale(arm.frame.right, 0.5));
    limb([arm.shoulder, arm.elbow, arm.wrist], right, &sections, build.height * build.girth.sqrt(), 1.0)
}

fn bare_arm(arm: &Arm, build: &Build) -> Vec<Ring> {
    let sections = [
        [0.4, 0.025, 0.027, 0.8],
        [0.75, 0.022, 0.024, 0.95],
        [0.97, 0.021, 0.022, 1.0],
        [1.2, 0.022, 0.023, 1.0],
        [1.6, 0.018, 0.018, 1.0],
        [1.97, 0.015, 0.013, 1.0],
    ];
    let joints = [arm.shoulder, arm.elbow, arm.wrist];
    limb(joints, arm.frame.right, &sections, build.height * build.girth.sqrt(), 1.0)
}

/// Hanging with the back outwards, the fingers a little bent.
fn hand(arm: &Arm, build: &Build, side: usize) -> Vec<Ring> {
    let size = build.height;
    let inwards = [1.0, -1.0][side];
    let sections: [[f64; 5]; 6] = [
        [0.004, 0.0, 0.012, 0.014, 0.0],
        [-0.012, 0.0, 0.011, 0.017, 0.0],
        [-0.036, 0.001, 0.011, 0.022, 0.002],
        [-0.056, 0.004, 0.010, 0.019, 0.003],
        [-0.080, 0.012, 0.007, 0.013, 0.002],
        [-0.092, 0.017, 0.0, 0.0, 0.002],
    ];
    let ring = |[up, inside, thick, wide, ahead]: [f64; 5]| Ring {
        centre: arm.frame.place(arm.wrist, [inwards * inside * size, up * size, ahead * size]),
        right: scale(arm.frame.right, thick * size),
        ahead: scale(arm.frame.ahead, wide * size),
        open: 1.0,
    };
    sections.map(ring).to_vec()
}

fn thumb(arm: &Arm, size: f64, side: usize) -> [Ring; 5] {
    let inwards = [1.0, -1.0][side];
    let frame = arm.frame.pitched(0.35);
    let middle = arm.frame.place(arm.wrist, [inwards * 0.004 * size, -0.034 * size, 0.020 * size]);
    let axes =
        [scale(frame.right, 0.006 * size), scale(frame.up, 0.022 * size), scale(frame.ahead, 0.007 * size)];
    egg(middle, axes, 0.95)
}

/// Cross-sections of the head: height over the chin, half width, half depth, how far ahead, light; in body heights.
const HEAD: [[f64; 5]; 11] = [
    [-0.002, 0.0, 0.0, 0.026, 0.7],
    [0.002, 0.016, 0.020, 0.022, 0.75],
    [0.014, 0.029, 0.037, 0.011, 0.85],
    [0.035, 0.038, 0.048, 0.004, 0.95],
    [0.062, 0.042, 0.054, 0.0, 1.0],
    [0.086, 0.042, 0.056, -0.003, 1.0],
    [0.104, 0.037, 0.050, -0.005, 1.0],
    [0.117, 0.029, 0.040, -0.006, 1.0],
    [0.126, 0.019, 0.027, -0.006, 1.0],
    [0.131, 0.009, 0.013, -0.006, 1.0],
    [0.132, 0.0, 0.0, -0.006, 1.0],
];

fn head(pose: &BodyPose, build: &Build, outfit: &Outfit, detail: Detail, patches: &mut Vec<SkinPatch>) {
    let size = build.height;
    let chin = pose.head.place(skull(pose, build), [0.0, -0.022 * size, 0.0]);
    let at = |right: f64, up: f64, ahead: f64| pose.head.place(chin, [right * size, up * size, ahead * size]);
    let Frame { right, up, ahead } = pose.head;
    let axes = |a: f64, b: f64, c: f64| [scale(right, a * size), scale(up, b * size), scale(ahead, c * size)];
    let rings = HEAD.map(|[height, width, depth, forward, open]| {
        let hair = outfit.hair_volume * ((height - 0.075) / 0.03).clamp(0.0, 1.0);
        let grown = |length: f64| if length > 0.0 { (length + hair) * size } else { 0.0 };
        Ring {
            centre: at(0.0, height + hair * 0.7, forward - hair * 0.5),
            right: scale(right, grown(width)),
            ahead: scale(ahead, grown(depth)),
            open,
        }
    });
    let mut face = skin(&rings, FACE, [0.0, 0.0], detail);
    let round = face.vertices[face.columns - 1].cloth[0];
    for vertex in &mut face.vertices {
        // The face is one tile, from ear to ear and from chin to crown.
        let height = dot(subtract(vertex.place, chin), up) / (0.131 * size);
        vertex.cloth = [vertex.cloth[0] / round * TILE, height.clamp(0.01, 0.98) * TILE];
    }
    patches.push(face);
    patches.push(skin(
        &egg(at(0.0, 0.050, 0.0515), axes(0.0065, 0.014, 0.0085), 1.0),
        SKIN,
        [0.0, 0.0],
        detail,
    ));
    for side in [-1.0, 1.0] {
        if !outfit.long_hair {
            let ear = egg(at(side * 0.043, 0.06, -0.006), axes(0.005, 0.017, 0.010), 0.85);
            patches.push(skin(&ear, SKIN, [0.0, 0.0], detail));
        }
    }
    if outfit.long_hair {
        let tail = egg(at(0.0, 0.045, -0.052), axes(0.043, 0.062, 0.022), 0.95);
        patches.push(skin(&tail, HAIR, [0.0, 0.0], detail));
    }
}
