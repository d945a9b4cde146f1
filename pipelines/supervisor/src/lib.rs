//! Runs a pipeline until Ctrl-C, SIGTERM or SIGHUP, and starts it anew where it ends for any other reason: the video of a
//! camera that reboots ends, or fails, and `vapixptzsink` alone cannot bring that back.
//!
//! That nothing comes any more is for the pipeline to tell: by `souphttpsrc timeout=1`, or the element `watchdog`.

mod backoff;

use std::cell::{Cell, RefCell};
use std::error::Error;
use std::ops::ControlFlow;
use std::rc::Rc;
use std::time::{Duration, Instant};

use backoff::Backoff;
use gst::prelude::*;

/// SIGHUP, SIGINT and SIGTERM.
const ENDS: [i32; 3] = [1, 2, 15];

/// After being told to end, the stream's end is waited for this long, so that files are complete.
const LONGEST_END: Duration = Duration::from_secs(10);

/// What is happening now, shared with the handlers of signals and messages.
#[derive(Default)]
struct State {
    main_loop: RefCell<Option<glib::MainLoop>>,
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
    mut on_message: impl FnMut(&gst::Message) + 'static,
) -> Result<(), Box<dyn Error>> {
    let state = Rc::new(State::default());
    let signals = ENDS.map(|signal| {
        let state = state.clone();
        glib_unix::unix_signal_add_local(signal, move || {
            state.end();
            glib::ControlFlow::Continue
        })
    });
    let mut backoff = Backoff::default();
    let mut result = Ok(());
    while !state.told_to_end.get() {
        let pipeline = match build() {
            Ok(pipeline) => pipeline,
            Err(err) => {
                result = Err(err);
                break;
            }
        };
        let begin = Instant::now();
        state.play(pipeline, &mut on_message)?;
        if let Some(err) = state.hopeless.take() {
            result = Err(err.into());
            break;
        }
        if !state.told_to_end.get() {
            state.pause(backoff.after(begin.elapsed()));
        }
    }
    signals.into_iter().for_each(glib::SourceId::remove);
    result
}

impl State {
    /// Plays it to its end, whatever that is.
    fn play(
        self: &Rc<Self>,
        pipeline: gst::Pipeline,
        on_message: &mut impl FnMut(&gst::Message),
    ) -> Result<(), Box<dyn Error>> {
        let bus = pipeline.bus().ok_or("a pipeline without a bus")?;
        self.pipeline.replace(Some(pipeline.clone()));
        let context = glib::MainContext::default();
        let waker = context.clone();
        let (sender, messages) = std::sync::mpsc::channel();
        bus.set_sync_handler(move |_, message| {
            // In this order: the bus itself queues a message only after its handlers.
            let _ = sender.send(message.clone());
            waker.wakeup();
            gst::BusSyncReply::Drop
        });
        // Where it fails, a message has the reason.
        let _ = pipeline.set_state(gst::State::Playing);
        let mut give_up = None;
        'playing: loop {
            while let Ok(message) = messages.try_recv() {
                on_message(&message);
                if self.heard(&message).is_break() {
                    break 'playing;
                }
            }
            if self.told_to_end.get() {
                let at = *give_up.get_or_insert_with(|| Instant::now() + LONGEST_END);
                if at <= Instant::now() {
                    break;
                }
            }
            context.iteration(true);
        }
        bus.unset_sync_handler();
        self.pipeline.take();
        pipeline.set_state(gst::State::Null)?;
        Ok(())
    }

    fn heard(&self, message: &gst::Message) -> ControlFlow<()> {
        match message.view() {
            gst::MessageView::Eos(_) => ControlFlow::Break(()),
            gst::MessageView::Error(error) => {
                let error = error.error();
                if error.matches(gst::ResourceError::NotAuthorized) {
                    self.hopeless.replace(Some(error));
                }
                ControlFlow::Break(())
            }
            _ => ControlFlow::Continue(()),
        }
    }

    /// Waits for a while, or until told to end.
    fn pause(self: &Rc<Self>, pause: Duration) {
        let main_loop = glib::MainLoop::new(None, false);
        self.main_loop.replace(Some(main_loop.clone()));
        let over = main_loop.clone();
        glib::timeout_add_local_once(pause, move || over.quit());
        main_loop.run();
        self.main_loop.take();
    }

    /// A signal came: the stream ends, and everything after it.
    fn end(&self) {
        self.told_to_end.set(true);
        if let Some(pipeline) = &*self.pipeline.borrow() {
            pipeline.send_event(gst::event::Eos::new());
            // Wakes the one who waits for messages when nothing comes any more.
            glib::timeout_add_local_once(LONGEST_END, || {});
        }
        if let Some(main_loop) = &*self.main_loop.borrow() {
            main_loop.quit();
        }
    }
}
