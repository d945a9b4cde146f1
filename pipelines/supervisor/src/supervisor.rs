// SPDX-License-Identifier: MPL-2.0

use std::cell::RefCell;
use std::error::Error;
use std::rc::Rc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use gst::prelude::*;

use crate::backoff::Backoff;

/// After being told to end, the stream's end is waited for this long, so that files are complete.
const LONGEST_END: Duration = Duration::from_secs(10);

/// Runs one pipeline after the other in one thread; a clone in another thread can end that.
#[derive(Debug, Clone)]
pub struct Supervisor(Arc<State>);

/// What is happening now, shared with the handlers of messages and whoever ends it.
#[derive(Debug)]
struct State {
    main_loop: glib::MainLoop,
    pipeline: Mutex<Option<gst::Pipeline>>,
    told_to_end: AtomicBool,
    hopeless: Mutex<Option<glib::Error>>,
}

impl Default for Supervisor {
    /// One that runs the main context of this thread: its own, or the default one.
    fn default() -> Self {
        Self::new(&glib::MainContext::ref_thread_default())
    }
}

impl Supervisor {
    /// One that runs a main context.
    pub fn new(context: &glib::MainContext) -> Self {
        Self(Arc::new(State {
            main_loop: glib::MainLoop::new(Some(context), false),
            pipeline: Mutex::default(),
            told_to_end: AtomicBool::default(),
            hopeless: Mutex::default(),
        }))
    }

    /// Runs what `build` makes, again and again, until told to end; where it makes nothing, as there is nobody to connect to,
    /// it is asked again after a pause. `on_message` hears every message. To be called in a thread whose main context is the
    /// supervisor's.
    ///
    /// # Errors
    /// Those of `build`, and an error after which a new start would end in the same way, as user and password are wrong:
    /// to try that again and again could lock the account.
    pub fn run(
        &self,
        mut build: impl FnMut() -> Result<Option<gst::Pipeline>, Box<dyn Error>>,
        on_message: impl FnMut(&gst::Message) + 'static,
    ) -> Result<(), Box<dyn Error>> {
        let on_message = Rc::new(RefCell::new(on_message));
        let mut backoff = Backoff::default();
        while !self.told_to_end() {
            let pipeline = build()?;
            let begin = Instant::now();
            if let Some(pipeline) = pipeline {
                self.play(&pipeline, on_message.clone())?;
            }
            if let Some(err) = lock(&self.0.hopeless).take() {
                return Err(err.into());
            }
            if !self.told_to_end() {
                self.wait_at_most(backoff.after(begin.elapsed()));
                self.0.main_loop.run();
            }
        }
        Ok(())
    }

    /// Ends the stream, and everything after it. From any thread; returns at once.
    pub fn end(&self) {
        self.0.told_to_end.store(true, Ordering::SeqCst);
        self.later(|this| {
            let pipeline = lock(&this.0.pipeline).clone();
            match pipeline {
                Some(pipeline) => {
                    pipeline.send_event(gst::event::Eos::new());
                    this.wait_at_most(LONGEST_END);
                }
                None => this.0.main_loop.quit(),
            }
        });
    }

    /// Starts the pipeline anew, as something is wrong that it did not notice. From any thread; returns at once.
    pub fn restart(&self) {
        self.later(|this| {
            if lock(&this.0.pipeline).is_some() {
                this.0.main_loop.quit();
            }
        });
    }

    /// Done by the loop, in its thread, even where it does not run yet.
    fn later(&self, what: impl FnOnce(&Self) + Send + 'static) {
        let source = glib::idle_source_new(None, glib::Priority::DEFAULT, self.once(what));
        source.attach(Some(&self.0.main_loop.context()));
    }

    /// Of a source that is done once. One that waits for a loop that never runs again must not hold it: each would keep the other, and
    /// a descriptor.
    fn once(
        &self,
        what: impl FnOnce(&Self) + Send + 'static,
    ) -> impl FnMut() -> glib::ControlFlow + Send + 'static {
        let state = Arc::downgrade(&self.0);
        let mut what = Some(what);
        move || {
            if let Some((what, state)) = what.take().zip(state.upgrade()) {
                what(&Self(state));
            }
            glib::ControlFlow::Break
        }
    }

    fn told_to_end(&self) -> bool {
        self.0.told_to_end.load(Ordering::SeqCst)
    }

    /// Plays it to its end, whatever that is.
    fn play(
        &self,
        pipeline: &gst::Pipeline,
        on_message: Rc<RefCell<impl FnMut(&gst::Message) + 'static>>,
    ) -> Result<(), Box<dyn Error>> {
        let bus = pipeline.bus().ok_or("a pipeline without a bus")?;
        *lock(&self.0.pipeline) = Some(pipeline.clone());
        let this = self.clone();
        let watch = bus.add_watch_local(move |_, message| {
            on_message.borrow_mut()(message);
            this.heard(message);
            glib::ControlFlow::Continue
        })?;
        // Where it fails, a message has the reason.
        let _ = pipeline.set_state(gst::State::Playing);
        self.0.main_loop.run();
        drop(watch);
        lock(&self.0.pipeline).take();
        pipeline.set_state(gst::State::Null)?;
        Ok(())
    }

    fn heard(&self, message: &gst::Message) {
        match message.view() {
            gst::MessageView::Eos(_) => self.0.main_loop.quit(),
            gst::MessageView::Error(error) => {
                let error = error.error();
                if error.matches(gst::ResourceError::NotAuthorized) {
                    *lock(&self.0.hopeless) = Some(error);
                }
                self.0.main_loop.quit();
            }
            _ => {}
        }
    }

    /// Whatever the main loop runs for is over after this.
    fn wait_at_most(&self, time: Duration) {
        let quit = self.once(|this| this.0.main_loop.quit());
        let source = glib::timeout_source_new(time, None, glib::Priority::DEFAULT, quit);
        source.attach(Some(&self.0.main_loop.context()));
    }
}

/// Nothing panics while one of these is held.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Something that lives as long as its sources.
    fn witness(context: &glib::MainContext) -> std::sync::Weak<()> {
        let (kept, hour) = (Arc::new(()), Duration::from_secs(3600));
        let witness = Arc::downgrade(&kept);
        let source = glib::timeout_source_new(hour, None, glib::Priority::DEFAULT, move || {
            let _ = &kept;
            glib::ControlFlow::Continue
        });
        source.attach(Some(context));
        witness
    }

    #[test]
    fn nothing_is_left_of_one_that_was_told_to_end() {
        gst::init().unwrap();
        let context = glib::MainContext::new();
        let witness = witness(&context);
        let supervisor = Supervisor::new(&context);
        let build = || {
            let pipeline = gst::parse::launch("fakesrc ! fakesink").map_err(|err| err.to_string())?;
            Ok(pipeline.downcast::<gst::Pipeline>().ok())
        };
        let ends = supervisor.clone();
        let end = move |message: &gst::Message| {
            // Before it plays, a source that is told to end may wait for a sink that waits for it.
            if let gst::MessageView::StateChanged(change) = message.view()
                && change.current() == gst::State::Playing
                && message.src().is_some_and(|source| source.is::<gst::Pipeline>())
            {
                ends.end();
            }
        };
        context.with_thread_default(|| supervisor.run(build, end).unwrap()).unwrap();
        // As whoever asks for the end of a camera does that was given up.
        supervisor.end();
        drop((context, supervisor));
        assert!(witness.upgrade().is_none());
    }
}
