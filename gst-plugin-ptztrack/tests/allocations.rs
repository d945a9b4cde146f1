// SPDX-License-Identifier: MPL-2.0

//! What is allocated for a picture once somebody is followed: nothing by our own code in detector and tracker.
//!
//! Counted is what goes through Rust's allocator on the streaming thread, which is this one: a harness pushes. That is our
//! code and the bindings', which make a C string of each name that they hand to GStreamer; what GLib, GStreamer and OpenCV
//! allocate themselves is not (see `docs/benchmarks.md`).
#![allow(clippy::unwrap_used, clippy::expect_used, missing_docs)]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

use gst_check::Harness;
use ptztrack_contract::{BufferMeta, MotionMeta, TargetMeta, TargetState};

/// The system's allocator, which counts while it is asked to.
struct Counting;

thread_local! {
    static COUNTS: Cell<bool> = const { Cell::new(false) };
    static COUNT: Cell<usize> = const { Cell::new(0) };
}

impl Counting {
    fn note() {
        COUNT.set(COUNT.get() + usize::from(COUNTS.get()));
    }

    /// How much `work` allocates on this thread.
    fn during<T>(work: impl FnOnce() -> T) -> (T, usize) {
        COUNT.set(0);
        COUNTS.set(true);
        let done = work();
        COUNTS.set(false);
        (done, COUNT.get())
    }
}

// SAFETY: all is left to the system's allocator; counting allocates nothing.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        Self::note();
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        Self::note();
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn realloc(&self, memory: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        Self::note();
        unsafe { System.realloc(memory, layout, size) }
    }

    unsafe fn dealloc(&self, memory: *mut u8, layout: Layout) {
        unsafe { System.dealloc(memory, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

const SIZE: (usize, usize) = (640, 480);
/// Of the person, pixels.
const PERSON: (usize, usize) = (60, 150);
/// Pictures from one end of the walk to the other.
const WALK: u64 = 60;
const STEP: gst::ClockTime = gst::ClockTime::from_mseconds(40);

/// Blocks of `grain` pixels a side, of any grey.
fn texture(seed: usize, x: usize, y: usize, grain: usize) -> u8 {
    let mut hash = seed.wrapping_mul(0x9e37_79b9)
        ^ (x / grain).wrapping_mul(0x85eb_ca6b)
        ^ (y / grain).wrapping_mul(0xc2b2_ae35);
    hash ^= hash >> 13;
    hash = hash.wrapping_mul(0x27d4_eb2f);
    (hash >> 9) as u8
}

/// Somebody in coloured clothes who walks to and fro before a wall, in I420; where the camera turns, so does the wall.
fn picture(number: u64, turns: bool) -> Vec<u8> {
    let (width, height) = SIZE;
    let phase = number % (2 * WALK);
    let way = phase.min(2 * WALK - phase) as usize;
    let pan = if turns { way } else { 0 };
    let noise = |x, y| texture(number as usize % 7 + 3, x, y, 1) % 4;
    let wall = |x, y| 64 + texture(1, x + pan, y, 8) / 4 + noise(x, y);
    let mut pixels: Vec<u8> = (0..width * height).map(|at| wall(at % width, at / width)).collect();
    let (left, top) = (150 + 5 * way, 200);
    for y in 0..PERSON.1 {
        for x in 0..PERSON.0 {
            pixels[(top + y) * width + left + x] = texture(7, x, y, 6);
        }
    }
    for tint in [100, 170] {
        let plane = pixels.len();
        pixels.resize(plane + width * height / 4, 128);
        for y in top / 2..(top + PERSON.1) / 2 {
            pixels[plane + y * width / 2 + left / 2..][..PERSON.0 / 2].fill(tint);
        }
    }
    pixels
}

/// What each element, in the order of their names, allocates for the pictures of the third walk to and fro, the least first.
fn counts(names: [&str; 3], turns: bool) -> [Vec<usize>; 3] {
    gst::init().unwrap();
    gstptztrack::plugin_register_static().unwrap();
    let caps = format!("video/x-raw,format=I420,width={},height={},framerate=25/1", SIZE.0, SIZE.1);
    let mut harnesses = names.map(|name| {
        let mut harness = Harness::new(name);
        harness.set_caps_str(&caps, "video/x-raw");
        harness
    });
    let mut counts = [const { Vec::new() }; 3];
    for number in 0..6 * WALK {
        let mut buffer = gst::Buffer::from_mut_slice(picture(number, turns));
        buffer.get_mut().unwrap().set_pts(STEP * number);
        for index in 0..harnesses.len() {
            let (before, harness) = harnesses.split_at_mut(index);
            let (pushed, count) = Counting::during(|| harness[0].push_and_pull(buffer));
            buffer = pushed.unwrap();
            let is_steady = number >= 4 * WALK;
            counts[index].extend(is_steady.then_some(count));
            // What the tracker tells the detector.
            while let Some(event) = before.last_mut().and_then(|_| harness[0].try_pull_upstream_event()) {
                let (_, count) = Counting::during(|| before[index - 1].push_upstream_event(event));
                assert!(!is_steady || count == 0, "{count} for an event");
            }
        }
        if number >= 4 * WALK {
            assert_eq!(TargetMeta::of(&buffer).unwrap().unwrap().state, TargetState::Tracking);
            assert_eq!(MotionMeta::of(&buffer).unwrap().unwrap().regions.len(), 1);
        }
    }
    counts.iter_mut().for_each(|counts| counts.sort_unstable());
    counts
}

/// Names that the bindings make C strings of. Detector: of two metas, each looked for and added, and of a region of interest.
/// Tracker: of two metas that it looks for, two that it looks for and adds, and of a region of interest.
const NAMES: [usize; 2] = [5, 7];
/// The overlay's, at most: three names of metas, four lines of text handed to OpenCV to be measured, and what it draws from: regions,
/// points and tracks as they are read, the trail, and shapes with their points and words.
const DRAWN: usize = 34;

/// What is kept grows by one more allocation in so many pictures at most: none is just like another.
const RARELY: usize = 10;

#[test]
fn nothing_is_allocated_for_a_picture_but_names() {
    for turns in [false, true] {
        let counts = counts(["bgavgdetect", "lkfeaturetrack", "ptzoverlay"], turns);
        let [detector, tracker, overlay] = counts.each_ref().map(|counts| counts[counts.len() / 2]);
        assert_eq!([detector, tracker], NAMES, "turns: {turns}");
        assert!(overlay <= DRAWN, "{overlay}, turns: {turns}");
        for (counts, names) in counts.iter().zip(NAMES) {
            let beyond: usize = counts.iter().map(|count| count - names).sum();
            assert!(beyond <= counts.len() / RARELY, "{beyond} beyond, turns: {turns}");
        }
    }
}
