// SPDX-License-Identifier: MPL-2.0

//! The live page, in a headless Chromium.
#![allow(clippy::unwrap_used, clippy::expect_used)]

#[path = "common/browser.rs"]
mod browser;
mod common;

use std::time::Duration;

use browser::Browser;
use common::{PATIENCE, settings};
use serde_json::json;
use virtual_camera::{Clock, RoomSettings, Settings, SyntheticSettings, VirtualCamera, Waypoint, World};

const TRUTH_DRAWN: &str = "$('truth').getContext('2d') \
     .getImageData(0, 0, $('truth').width, $('truth').height).data.some(value => value > 200)";

/// Before somebody who stands a little to the right.
fn with_a_person() -> Settings {
    let here = Waypoint { time: Duration::ZERO, pan_deg: 6.0, tilt_deg: -2.0 };
    let world = SyntheticSettings { size: (512, 384), path: vec![here], stays: true, ..Default::default() };
    Settings { world: World::Synthetic(world), ..settings() }
}

#[test]
fn the_page_shows_the_camera_and_steers_it() {
    let mut browser = Browser::start("chromium-steering");
    let auth = virtual_camera::Auth::Digest { qop: true };
    let camera = VirtualCamera::start(Settings { auth, ..with_a_person() }).unwrap();
    browser.open(&camera.url());

    // It shows the picture, the overview with the view drawn in, and the numbers, and asks for no password.
    browser.wait_for("typeof $ == 'function' && $('picture').naturalWidth == 160");
    browser.wait_for("$('overview').naturalWidth == 512");
    browser.wait_for("$('pan').textContent == '0.00°' && $('state').textContent == 'at rest'");
    browser.wait_for(
        "$('outline').getContext('2d').getImageData(0, 0, $('outline').width, $('outline').height) \
         .data.some(value => value > 200)",
    );
    assert_eq!(browser.value("$('commands').children.length"), json!(0));

    // The truth is drawn in where it is asked for.
    assert_eq!(browser.value(TRUTH_DRAWN), json!(false));
    browser.click("show-truth");
    browser.wait_for(TRUTH_DRAWN);
    browser.save_picture("live-page-truth.png");
    browser.click("show-truth");
    browser.wait_for(&format!("!({TRUTH_DRAWN})"));

    // A button held moves the camera, released it stops.
    browser.mouse("mousePressed", "right");
    assert!(camera.wait_for(PATIENCE, |status| status.pan_rate_deg_s > 1.0));
    browser.wait_for("$('state').textContent == 'moving' && parseFloat($('pan').textContent) > 0.5");
    browser.mouse("mouseReleased", "right");
    assert!(camera.wait_for(PATIENCE, |status| !status.moving));
    browser.wait_for("$('commands').children.length == 2");
    browser.wait_for("$('commands').firstChild.textContent.endsWith('204  continuouspantiltmove=0,0')");
    browser.wait_for("$('commands').lastChild.textContent.endsWith('204  continuouspantiltmove=25,0')");

    // Zoom, and the way home.
    browser.mouse("mousePressed", "zoom-in");
    assert!(camera.wait_for(PATIENCE, |status| status.magnification > 1.2));
    browser.mouse("mouseReleased", "zoom-in");
    assert!(camera.wait_for(PATIENCE, |status| !status.moving));
    browser.save_picture("live-page.png");
    browser.click("home");
    assert!(camera.wait_for(PATIENCE, |status| status.pan_deg == 0.0 && status.zoom_step == 1.0));
    browser.wait_for("$('pan').textContent == '0.00°' && $('zoom').textContent.startsWith('1 (')");

    // A page that is closed while a button is held leaves no camera moving.
    browser.mouse("mousePressed", "left");
    assert!(camera.wait_for(PATIENCE, |status| status.pan_rate_deg_s < -1.0));
    browser.call("Page.navigate", json!({"url": "about:blank"}));
    assert!(camera.wait_for(PATIENCE, |status| !status.moving));
}

#[test]
fn the_room_is_shown_with_the_truth_if_the_address_asks_for_it() {
    let mut browser = Browser::start("chromium-room");
    let world = World::Room(RoomSettings::test(7, 1).unwrap());
    let settings = Settings { world, clock: Clock::Stepped, ..Settings::default() };
    let camera = VirtualCamera::start(settings).unwrap();
    // Somebody is in the middle of the room and, as nobody steps on, stays there.
    camera.advance_to(Duration::from_secs(6));
    browser.open(&format!("{}/?truth=1", camera.url()));
    browser.wait_for("typeof $ == 'function' && $('overview').naturalWidth == 1280");
    browser.wait_for(TRUTH_DRAWN);
    browser.wait_for("$('picture').naturalWidth == 640 && $('fov').textContent == '55.00° wide'");
    browser.save_picture("live-page-room.png");
}
