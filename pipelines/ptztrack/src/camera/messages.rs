// SPDX-License-Identifier: MPL-2.0

use std::collections::HashSet;
use std::sync::Arc;
use std::sync::atomic::Ordering;

use gst::MessageView;
use ptztrack_contract::lock::lock;
use ptztrack_contract::{CameraChange, CameraMessage, MOVE_REFUSED, TargetChange, TargetMessage};

use super::known::{Known, SEARCHING};
use crate::event::{Event, Level};
use crate::log::Log;

/// What elements call a property of theirs, and what the file calls it.
const LOCATION: &str = "`location`";
const ADDRESS: &str = "`address`";
/// How much of what was said is remembered: a camera may put anything into words that are told on.
const MOST_SAID: usize = 64;

/// Makes events of what a pipeline says, and keeps what is to be known of the camera.
pub struct Listener {
    known: Arc<Known>,
    log: Arc<Log>,
    /// What was said already: pipelines that start one after the other without a picture all say the same.
    said: HashSet<String>,
}

impl Listener {
    pub fn new(known: Arc<Known>, log: Arc<Log>) -> Self {
        Self { known, log, said: HashSet::new() }
    }

    pub fn hear(&mut self, message: &gst::Message) {
        match message.view() {
            MessageView::Error(error) => {
                self.fails();
                let error = error.error();
                if error.matches(gst::ResourceError::NotAuthorized) {
                    // It is given up, and that is told elsewhere.
                    return;
                }
                let known_better = lock(&self.known.ended).as_ref().map(|failure| failure.reason.clone());
                self.picture_gone(known_better.unwrap_or_else(|| error.message().to_owned()));
            }
            MessageView::Eos(_) => self.ends(),
            MessageView::Warning(warning) => {
                if warning.details().is_some_and(|details| details.name() == MOVE_REFUSED) {
                    lock(&self.known.state).refused_moves += 1;
                }
                self.trouble(Level::Warning, "warning", warning.error().message().to_owned(), "");
            }
            MessageView::Info(info) => {
                self.trouble(Level::Info, "info", info.error().message().to_owned(), "")
            }
            MessageView::Element(element) => {
                if let Some(structure) = element.structure() {
                    self.element(structure);
                }
            }
            _ => {}
        }
    }

    /// Nobody is there to send pictures.
    pub fn out_of_reach(&mut self, reason: String) {
        self.fails();
        self.picture_gone(reason);
    }

    fn fails(&self) {
        self.known.failures.fetch_add(1, Ordering::Relaxed);
        self.ends();
    }

    /// The pipeline is over, and what was seen in it with it.
    pub(super) fn ends(&self) {
        self.known.ends();
        let mut state = lock(&self.known.state);
        state.picture = false;
        // The next pipeline begins with nobody.
        state.target = SEARCHING.to_owned();
        state.target_id = None;
    }

    fn picture_gone(&mut self, reason: String) {
        // An element's own sentence ends here; what is retried is said once.
        let reason = reason.trim_end_matches('.').trim_end_matches("; retrying").to_owned();
        self.trouble(Level::Error, "picture-gone", reason, "; it is tried again until it is back");
    }

    /// The first picture of a pipeline is what ends the trouble before it.
    pub fn look_for_picture(&mut self) {
        let comes = self.known.has_picture();
        let mut state = lock(&self.known.state);
        if comes && !state.picture {
            state.picture = true;
            state.trouble = None;
            drop(state);
            self.said.clear();
            self.tell(Level::Info, "picture", "the picture is there");
        }
    }

    fn element(&mut self, structure: &gst::StructureRef) {
        if let Ok(target) = TargetMessage::from_structure(structure) {
            self.target(&target);
        } else if let Ok(camera) = CameraMessage::from_structure(structure) {
            self.camera(&camera);
        }
    }

    fn target(&mut self, target: &TargetMessage) {
        let gone = matches!(target.change, TargetChange::Lost | TargetChange::Released);
        let mut state = lock(&self.known.state);
        state.target = target.state.name().to_owned();
        state.target_id = (!gone).then_some(target.id);
        drop(state);
        let change = target.change.name();
        if target.change != TargetChange::Position {
            self.tell(Level::Info, &format!("target-{change}"), &format!("target {} {change}", target.id));
        }
    }

    fn camera(&mut self, camera: &CameraMessage) {
        let event = format!("camera-{}", camera.change.name());
        let detail = format!("camera {}: {}", camera.change.name(), camera.detail);
        match camera.change {
            // They come all the time.
            CameraChange::Moving | CameraChange::Stopped | CameraChange::AtLimit => {}
            CameraChange::Disconnected | CameraChange::Refused => {
                self.trouble(Level::Warning, &event, detail, "")
            }
            CameraChange::Connected => {
                self.said.retain(|said| !said.starts_with("camera-"));
                lock(&self.known.state).trouble = None;
                self.trouble(Level::Info, &event, detail, "");
            }
            CameraChange::TakenOver | CameraChange::Resumed => {
                let taken_over = camera.change == CameraChange::TakenOver;
                self.known.operator.store(taken_over, Ordering::Relaxed);
                self.tell(Level::Info, &event, &detail);
            }
        }
    }

    /// Told once, until a picture is there again.
    fn trouble(&mut self, level: Level, event: &str, text: String, what_now: &str) {
        let text = text.replace(LOCATION, ADDRESS);
        if level > Level::Info {
            lock(&self.known.state).trouble = Some(text.clone());
        }
        if self.said.len() >= MOST_SAID {
            self.said.clear();
        }
        if self.said.insert(format!("{event} {text}")) {
            self.tell(level, event, &format!("{text}{what_now}"));
        }
    }

    fn tell(&self, level: Level, event: &str, detail: &str) {
        self.log.tell(&Event::new(level, Some(&self.known.name), event, detail));
    }
}

#[cfg(test)]
mod tests {
    use ptztrack_contract::Times;

    use super::*;

    fn listener(log: &Arc<Log>) -> Listener {
        gst::init().unwrap();
        Listener::new(Arc::new(Known::new("door")), log.clone())
    }

    /// A sink says so.
    fn say(listener: &mut Listener, change: CameraChange, detail: &str) {
        let camera = CameraMessage { change, times: Times::default(), detail: detail.to_owned() };
        listener.hear(&gst::message::Element::new(camera.to_structure()));
    }

    #[test]
    fn every_outage_is_told_of_and_each_only_once() {
        let log = Arc::new(Log::unwritten());
        let (mut events, mut listener) = (log.subscribe(), listener(&log));
        for _ in 0..2 {
            say(&mut listener, CameraChange::Disconnected, "no route");
            say(&mut listener, CameraChange::Disconnected, "no route");
            say(&mut listener, CameraChange::Connected, "the camera answers");
        }
        let told: Vec<_> = std::iter::from_fn(|| events.try_recv().ok()).map(|event| event.event).collect();
        assert_eq!(told, ["camera-disconnected", "camera-connected"].repeat(2));
    }

    #[test]
    fn what_to_do_is_said_once_and_by_the_names_of_the_file() {
        let log = Arc::new(Log::unwritten());
        let (mut events, mut listener) = (log.subscribe(), listener(&log));
        listener.out_of_reach("cannot connect. Check `location`, the cable; retrying.".to_owned());
        let told = events.try_recv().unwrap().detail;
        assert_eq!(told, "cannot connect. Check `address`, the cable; it is tried again until it is back");
    }

    /// As of pictures that did not come for long, or of a mode that the camera does not have.
    #[test]
    fn what_an_element_only_informs_of_is_told_and_is_no_trouble() {
        let log = Arc::new(Log::unwritten());
        let (mut events, mut listener) = (log.subscribe(), listener(&log));
        listener.hear(&gst::message::Info::new(gst::StreamError::Failed, "no picture came for 2 s"));
        let told = events.try_recv().unwrap();
        assert_eq!(
            (told.level, &*told.event, &*told.detail),
            (Level::Info, "info", "no picture came for 2 s")
        );
        assert_eq!(lock(&listener.known.state).trouble, None);
    }

    #[test]
    fn what_a_camera_says_is_not_remembered_for_ever() {
        let mut listener = listener(&Arc::new(Log::unwritten()));
        (0..1000).for_each(|nth| say(&mut listener, CameraChange::Refused, &format!("{nth} is refused")));
        assert!(listener.said.len() <= MOST_SAID, "{}", listener.said.len());
    }
}
