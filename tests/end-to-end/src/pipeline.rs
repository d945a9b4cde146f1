// SPDX-License-Identifier: MPL-2.0

//! Pipelines inside the test process.

use std::sync::Once;
use std::time::Instant;

use gst::prelude::*;

/// Initialises GStreamer and registers our elements, once.
pub fn init() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        gst::init().unwrap();
        gstptztrack::plugin_register_static().unwrap();
        gstonvifptz::plugin_register_static().unwrap();
        gstvapix::plugin_register_static().unwrap();
    });
}

/// A pipeline that is stopped when the test ends, however it ends.
pub struct Running {
    pipeline: gst::Pipeline,
    warnings: Vec<String>,
    infos: Vec<String>,
}

impl Running {
    /// Parses and starts a pipeline.
    #[track_caller]
    pub fn start(description: &str) -> Self {
        let running = Self::parse(description);
        running.pipeline.set_state(gst::State::Playing).unwrap();
        running
    }

    /// Parses a pipeline without starting it.
    #[track_caller]
    pub fn parse(description: &str) -> Self {
        init();
        let pipeline = gst::parse::launch(description).unwrap().downcast::<gst::Pipeline>().unwrap();
        Self { pipeline, warnings: Vec::new(), infos: Vec::new() }
    }

    /// The pipeline.
    pub fn pipeline(&self) -> &gst::Pipeline {
        &self.pipeline
    }

    /// An element by the name given in the description.
    #[track_caller]
    pub fn element(&self, name: &str) -> gst::Element {
        self.pipeline.by_name(name).unwrap()
    }

    /// Waits for a message for which `wanted` gives something; an error message ends the test.
    /// Warnings that pass by are kept.
    #[track_caller]
    pub fn wait_for<T>(&mut self, what: &str, mut wanted: impl FnMut(&gst::Message) -> Option<T>) -> T {
        let bus = self.pipeline.bus().unwrap();
        let deadline = Instant::now() + crate::PATIENCE;
        loop {
            let left = deadline.saturating_duration_since(Instant::now());
            let left = gst::ClockTime::try_from(left).unwrap();
            let Some(message) = bus.timed_pop(left) else {
                panic!("{what} never came; warnings: {:?}", self.warnings);
            };
            if let gst::MessageView::Warning(warning) = message.view() {
                self.warnings.push(warning.error().to_string());
            }
            if let Some(found) = wanted(&message) {
                return found;
            }
            if let gst::MessageView::Error(error) = message.view() {
                panic!("waiting for {what}: {} ({:?})", error.error(), error.debug());
            }
        }
    }

    /// Waits for the element message that `read` understands and `wanted` accepts.
    #[track_caller]
    pub fn wait_for_message<T, E>(
        &mut self,
        what: &str,
        read: impl Fn(&gst::StructureRef) -> Result<T, E>,
        wanted: impl Fn(&T) -> bool,
    ) -> T {
        self.wait_for(what, |message| {
            let structure = message.structure().filter(|_| message.type_() == gst::MessageType::Element)?;
            read(structure).ok().filter(|found| wanted(found))
        })
    }

    /// The warnings posted so far, those still waiting on the bus included.
    pub fn warnings(&mut self) -> &[String] {
        self.listen();
        &self.warnings
    }

    /// The infos posted so far, alike.
    pub fn infos(&mut self) -> &[String] {
        self.listen();
        &self.infos
    }

    fn listen(&mut self) {
        let bus = self.pipeline.bus().unwrap();
        while let Some(message) = bus.pop_filtered(&[gst::MessageType::Warning, gst::MessageType::Info]) {
            match message.view() {
                gst::MessageView::Warning(warning) => self.warnings.push(warning.error().to_string()),
                gst::MessageView::Info(info) => self.infos.push(info.error().to_string()),
                _ => {}
            }
        }
    }

    /// The same, of what is amiss with others: where a busy machine is late, the loop itself may swing and say so.
    pub fn complaints(&mut self) -> Vec<String> {
        self.warnings()
            .iter()
            .filter(|warning| !warning.contains("oscillates about the target"))
            .cloned()
            .collect()
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        // Nothing more can be done about a pipeline that will not stop.
        let _ = self.pipeline.set_state(gst::State::Null);
    }
}
