//! Runs a pipeline until Ctrl-C, SIGTERM or SIGHUP, and starts it anew where it ends for any other reason: the video of a
//! camera that reboots ends, or fails, and `vapixptzsink` alone cannot bring that back.
//!
//! That nothing comes any more is for the pipeline to tell: by `souphttpsrc timeout=1`, or the element `watchdog`.

mod backoff;

use std::cell::{Cell, RefCell};
use std::error::Error;
use std::rc::Rc;
use std::time::{Duration, Instant};

use backoff::Backoff;
use gst::prelude::*;

/// SIGHUP, SIGINT and SIGTERM.
const ENDS: [i32; 3] = [1, 2, 15];

/// After being told to end, the stream's end is waited for this long, so that files are complete.
const LONGEST_END: Duration = Duration::from_secs(10);

/// What is happening now, shared with the handlers of signals and messages.
struct State {
    main_loop: glib::MainLoop,
    pipeline: RefCell<Option<gst::Pipeline>>,
    told_to_end: Cell<bool>,
    hopeless: RefCell<Option<glib::Error>>,
}

/// Runs what `build` makes, again and again, until the process is told to end; `on_message` hears every message. To be
/// called in the main thread: it runs the default main context.
///
/// # Errors
/// Those of `build`, and an error after which a new start would end in the same way, as user and password are wrong: to
/// try that again and again could lock the account.
pub fn run(
    build: impl Fn() -> Result<gst::Pipeline, Box<dyn Error>>,
    on_message: impl FnMut(&gst::Message) + 'static,
) -> Result<(), Box<dyn Error>> {
    let state = Rc::new(State {
        main_loop: glib::MainLoop::new(None, false),
        pipeline: RefCell::default(),
        told_to_end: Cell::default(),
        hopeless: RefCell::default(),
    });
    let signals = ENDS.map(|signal| {
        let state = state.clone();
        glib_unix::unix_signal_add_local(signal, move || {
            state.end();
            glib::ControlFlow::Continue
        })
    });
    let result = state.run(build, Rc::new(RefCell::new(on_message)));
    signals.into_iter().for_each(glib::SourceId::remove);
    result
}

impl State {
    fn run(
        self: &Rc<Self>,
        build: impl Fn() -> Result<gst::Pipeline, Box<dyn Error>>,
        on_message: Rc<RefCell<impl FnMut(&gst::Message) + 'static>>,
    ) -> Result<(), Box<dyn Error>> {
        let mut backoff = Backoff::default();
        while !self.told_to_end.get() {
            let pipeline = build()?;
            let begin = Instant::now();
            self.play(&pipeline, on_message.clone())?;
            if let Some(err) = self.hopeless.take() {
                return Err(err.into());
            }
            if !self.told_to_end.get() {
                self.wait_at_most(backoff.after(begin.elapsed()));
                self.main_loop.run();
            }
        }
        Ok(())
    }

    /// Plays it to its end, whatever that is.
    fn play(
        self: &Rc<Self>,
        pipeline: &gst::Pipeline,
        on_message: Rc<RefCell<impl FnMut(&gst::Message) + 'static>>,
    ) -> Result<(), Box<dyn Error>> {
        let bus = pipeline.bus().ok_or("a pipeline without a bus")?;
        self.pipeline.replace(Some(pipeline.clone()));
        let state = self.clone();
        let watch = bus.add_watch_local(move |_, message| {
            on_message.borrow_mut()(message);
            state.heard(message);
            glib::ControlFlow::Continue
        })?;
        // Where it fails, a message has the reason.
        let _ = pipeline.set_state(gst::State::Playing);
        self.main_loop.run();
        drop(watch);
        self.pipeline.take();
        pipeline.set_state(gst::State::Null)?;
        Ok(())
    }

    fn heard(&self, message: &gst::Message) {
        match message.view() {
            gst::MessageView::Eos(_) => self.main_loop.quit(),
            gst::MessageView::Error(error) => {
                let error = error.error();
                if error.matches(gst::ResourceError::NotAuthorized) {
                    self.hopeless.replace(Some(error));
                }
                self.main_loop.quit();
            }
            _ => {}
        }
    }

    /// Whatever the main loop runs for is over after this.
    fn wait_at_most(&self, time: Duration) {
        let main_loop = self.main_loop.clone();
        glib::timeout_add_local_once(time, move || main_loop.quit());
    }

    /// A signal came: the stream ends, and everything after it.
    fn end(&self) {
        self.told_to_end.set(true);
        match &*self.pipeline.borrow() {
            Some(pipeline) => {
                pipeline.send_event(gst::event::Eos::new());
                self.wait_at_most(LONGEST_END);
            }
            None => self.main_loop.quit(),
        }
    }
}
