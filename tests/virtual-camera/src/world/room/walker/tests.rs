use super::*;
use crate::{geometry::Pinhole, kinematics::Pose, world::room::settings::Subject};

fn lamps() -> Light {
    let lamps = [-5.4, -1.8, 1.8, 5.4].iter().flat_map(|&x| [1.0, 5.5].map(|z| [x, 3.2, z])).collect();
    Light { lamps, windows: vec![[-8.9, 1.6, 5.0]] }
}

fn save(canvas: &Canvas, path: &str) {
    let (w, h) = canvas.size();
    let mut out = format!("P6\n{w} {h}\n255\n").into_bytes();
    for row in 0..h as usize {
        for column in 0..w as usize {
            let y = f64::from(canvas.planes[0].data[row * w as usize + column]) - 16.0;
            let c = row / 2 * canvas.planes[1].width + column / 2;
            let u = f64::from(canvas.planes[1].data[c]) - 128.0;
            let v = f64::from(canvas.planes[2].data[c]) - 128.0;
            let y = y * 255.0 / 219.0;
            for value in [y + 1.596 * v, y - 0.392 * u - 0.813 * v, y + 2.017 * u] {
                out.push(value.round().clamp(0.0, 255.0) as u8);
            }
        }
    }
    std::fs::write(path, out).unwrap();
}

fn looking(pan_deg: f64, tilt_deg: f64, fov_deg: f64, size: (u32, u32)) -> View {
    let pose = Pose { pan_deg, tilt_deg, ..Pose::default() };
    View::new(&pose, Pinhole::new(size.0, size.1, fov_deg), size)
}

#[test]
#[ignore]
fn strips() {
    for (index, number) in [1u32, 2, 3].into_iter().enumerate() {
        let settings =
            RoomSettings::test(number, std::env::var("SEED").map_or(1, |s| s.parse().unwrap())).unwrap();
        let walker = Walker::new(&settings);
        let mut sheet = Canvas::grey(1600, 900, 150);
        for phase in 0..8 {
            let time = 5.0 + f64::from(phase) * 1.04 / 8.0;
            let pose = walker.pose_at(time);
            let (pan, tilt) = (pose.place[0].atan2(pose.place[2]).to_degrees(), -14.0);
            let mut view = looking(pan, tilt, 55.0 * 0.62, (1600, 900));
            view.pinhole.centre_x = 100.0 + 200.0 * f64::from(phase);
            walker.draw_shadow(&pose, &view, &mut sheet);
            walker.draw(&pose, &view, &lamps(), &mut sheet);
        }
        save(&sheet, &format!("/tmp/strip{}.ppm", index));
    }
}
