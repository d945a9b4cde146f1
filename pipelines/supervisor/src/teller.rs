// SPDX-License-Identifier: MPL-2.0

//! Tells a user what elements have to say: a fault once when it begins, and when it is over.

use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::error::Error;
use std::io::Write;
use std::iter::successors;
use std::rc::Rc;
use std::time::{Duration, Instant};

use gst::prelude::*;
use pipeline_supervisor::LogIn;
use pipeline_supervisor::reach::ADVICE;
use session::http::without_user_info;

/// How much of what was said is remembered: a camera may put anything into words that are told on.
const MOST_SAID: usize = 64;
/// Message of a pipeline to which a picture has come.
const PICTURE: &str = "picture";

/// Hears what pipelines say that run one after the other, and tells it: faults to `err`, everything else to `out`.
pub struct Teller<O, E> {
    log_in: Rc<LogIn>,
    out: O,
    err: E,
    /// Number of the pipeline.
    run: u32,
    /// Names of its sources, and where they are.
    sources: Vec<(String, String)>,
    /// It has failed, and that was heard. Whatever fails after that, in the same pipeline, follows from it.
    failed: bool,
    /// Why nothing is tried again.
    refusal: Option<String>,
    /// It has had a picture.
    picture: bool,
    /// Pictures are gone, and that was told.
    gone: bool,
    /// What it said since then that is no fault: most pipelines without a picture say the same.
    held: Vec<String>,
    /// Warnings of this pipeline that one before it gave as well: an element that goes on with a picture does not repeat them.
    repeated: Vec<String>,
    said: HashMap<String, Said>,
    /// A fault that comes and goes is told no more often.
    quiet: Duration,
}

/// A fault that was told.
struct Said {
    /// By this pipeline first: two elements of one may say the same.
    run: u32,
    at: Instant,
    /// There was a picture since.
    over: bool,
}

impl<O: Write, E: Write> Teller<O, E> {
    /// With nothing heard yet; `log_in` knows some faults better than elements do, and one that comes and goes is told once in `quiet`.
    pub fn new(log_in: Rc<LogIn>, out: O, err: E, quiet: Duration) -> Self {
        Self {
            log_in,
            out,
            err,
            run: 0,
            sources: Vec::new(),
            failed: false,
            refusal: None,
            picture: false,
            gone: false,
            held: Vec::new(),
            repeated: Vec::new(),
            said: HashMap::new(),
            quiet,
        }
    }

    /// Another pipeline begins, as the one before has ended: its number.
    pub fn next_run(&mut self) -> u32 {
        if self.run > 0 && !self.failed {
            self.fail(self.at_cameras("the stream has ended"), false);
        }
        self.failed = false;
        self.run += 1;
        self.picture = false;
        self.held.clear();
        self.repeated.clear();
        self.run
    }

    /// This one, before it is logged in.
    pub fn watch(&mut self, pipeline: &gst::Pipeline) {
        let elements = pipeline.iterate_recurse().into_iter().flatten();
        self.sources = elements.filter_map(|element| address(&element)).collect();
        for sink in pipeline.iterate_sinks().into_iter().flatten() {
            let pipeline = pipeline.downgrade();
            for pad in sink.sink_pads() {
                let pipeline = pipeline.clone();
                let data = gst::PadProbeType::BUFFER | gst::PadProbeType::BUFFER_LIST;
                pad.add_probe(data, move |pad, _| post_picture(pad, &pipeline));
            }
        }
    }

    /// Nothing begins any more.
    pub fn end(&mut self, result: &Result<(), Box<dyn Error>>) {
        if let Err(err) = result {
            // An element may have said so already.
            self.run += 1;
            let fault = self.refusal.take().unwrap_or_else(|| err.to_string());
            self.tell_fault(&fault, "");
            let _ = writeln!(self.err, "Not restarted: it would fail in the same way.");
        }
    }

    pub fn hear(&mut self, message: &gst::Message) {
        let from = || message.src().map_or_else(String::new, |source| source.path_string().to_string());
        match message.view() {
            gst::MessageView::Error(error) if !self.failed => {
                let error = error.error();
                let refused = error.matches(gst::ResourceError::NotAuthorized);
                self.fail(self.reason(message.src(), &error), refused);
            }
            gst::MessageView::Warning(warning) => {
                let warning = warning.error();
                // While there are pictures, elements tell each fault once by themselves.
                let line = format!("WARNING: {}: {warning}", from());
                if self.picture || self.is_new(warning.message()) {
                    let _ = writeln!(self.err, "{line}");
                } else {
                    keep(&mut self.repeated, line);
                }
            }
            gst::MessageView::Info(info) => self.tell(format!("INFO: {}: {}", from(), info.error())),
            gst::MessageView::Application(it) if it.structure().is_some_and(|it| it.has_name(PICTURE)) => {
                self.picture_comes();
            }
            gst::MessageView::Element(element) => {
                if let Some(structure) = element.structure() {
                    self.tell(structure.to_string());
                }
            }
            _ => {}
        }
    }

    /// The pipeline is over, for this reason unless it is known better.
    fn fail(&mut self, reason: String, refused: bool) {
        self.failed = true;
        match self.log_in.ended() {
            Some(ended) if ended.refused => self.refusal = Some(ended.reason),
            _ if refused => self.refusal = Some(reason),
            ended => {
                let reason = ended.map_or(reason, |ended| self.at_cameras(&ended.reason));
                self.gone |= self.tell_fault(&reason, "; it is tried again until it is back");
            }
        }
    }

    fn tell(&mut self, line: String) {
        if self.gone {
            keep(&mut self.held, line);
        } else {
            let _ = writeln!(self.out, "{line}");
        }
    }

    /// Returns whether it was told now.
    fn tell_fault(&mut self, fault: &str, what_now: &str) -> bool {
        let is_new = self.is_new(fault);
        if is_new {
            // An element's own sentence ends here.
            let fault = fault.trim_end_matches('.').trim_end_matches("; retrying");
            let _ = writeln!(self.err, "ERROR: {fault}{what_now}");
        }
        is_new
    }

    fn picture_comes(&mut self) {
        self.picture = true;
        self.said.values_mut().for_each(|said| said.over = true);
        if std::mem::take(&mut self.gone) {
            let _ = writeln!(self.err, "INFO: the picture is there");
            for line in std::mem::take(&mut self.held) {
                self.tell(line);
            }
        }
        for line in std::mem::take(&mut self.repeated) {
            let _ = writeln!(self.err, "{line}");
        }
    }

    /// Whether no pipeline before this one has said that since the last picture, nor lately.
    fn is_new(&mut self, text: &str) -> bool {
        if self.said.len() >= MOST_SAID {
            self.said.clear();
        }
        // Each writes to a file of its own.
        let text = text.replace(&run_suffix(self.run), "");
        let now = Said { run: self.run, at: Instant::now(), over: false };
        match self.said.entry(text) {
            Entry::Occupied(mut said) if said.get().over && said.get().at.elapsed() >= self.quiet => {
                said.insert(now);
                true
            }
            Entry::Occupied(said) => said.get().run == self.run && !said.get().over,
            Entry::Vacant(place) => {
                place.insert(now);
                true
            }
        }
    }

    /// What is wrong, where, and what to do.
    fn reason(&self, source: Option<&gst::Object>, error: &glib::Error) -> String {
        let Some(element) = source else { return error.message().to_owned() };
        if let Some(silence) = silence(element) {
            return self.at_cameras(&format!("nothing came for {silence} ms. {ADVICE}"));
        }
        let text = error.message().trim_end_matches('.');
        let within = successors(Some(element.clone()), |part| part.parent());
        let own = within.filter_map(|part| self.sources.iter().find(|(name, _)| part.name() == *name)).next();
        if let Some((_, address)) = own {
            let refused = error.matches(gst::ResourceError::NotAuthorized);
            let advice = if refused { "Check user and password" } else { ADVICE };
            return format!("{address}: {text}. {advice}");
        }
        let Some(element) = element.downcast_ref::<gst::Element>() else { return text.to_owned() };
        // Its name has another number in each pipeline.
        let kind = element.factory().map_or_else(|| element.name(), |factory| factory.name());
        let text = format!("{kind}: {text}");
        // What is between camera and sinks fails by what the camera sends.
        let is_sink = element.element_flags().contains(gst::ElementFlags::SINK);
        if is_sink { text } else { self.at_cameras(&text) }
    }

    /// With the addresses before it.
    fn at_cameras(&self, text: &str) -> String {
        let addresses = self.sources.iter().map(|(_, address)| format!("{address}: "));
        addresses.collect::<String>() + text
    }
}

/// What takes the place of `{run}`.
pub fn run_suffix(run: u32) -> String {
    if run > 1 { format!("-{run}") } else { String::new() }
}

/// Name and address of a source.
fn address(element: &gst::Element) -> Option<(String, String)> {
    let is_source = element.element_flags().contains(gst::ElementFlags::SOURCE);
    let has_address = is_source && element.has_property_with_type("location", glib::Type::STRING);
    let address = has_address.then(|| element.property::<Option<String>>("location")).flatten()?;
    Some((element.name().to_string(), without_user_info(&address)))
}

/// For how many milliseconds nothing came, where an element says that.
fn silence(element: &gst::Object) -> Option<i32> {
    let factory = element.downcast_ref::<gst::Element>()?.factory()?;
    (factory.name() == "watchdog").then(|| element.property("timeout"))
}

/// Keeps the last of them.
fn keep(lines: &mut Vec<String>, line: String) {
    if lines.len() >= MOST_SAID {
        lines.remove(0);
    }
    lines.push(line);
}

/// Has the pipeline say that a picture has come; packets that go nowhere, as in the branch of a `watchdog`, are none yet.
fn post_picture(pad: &gst::Pad, pipeline: &glib::WeakRef<gst::Pipeline>) -> gst::PadProbeReturn {
    let is_rtp = pad
        .current_caps()
        .is_some_and(|caps| caps.structure(0).is_some_and(|caps| caps.has_name("application/x-rtp")));
    let factory = pad.parent_element().and_then(|sink| sink.factory());
    if is_rtp && factory.is_some_and(|factory| factory.name() == "fakesink") {
        return gst::PadProbeReturn::Ok;
    }
    if let Some(pipeline) = pipeline.upgrade() {
        let picture = gst::Structure::new_empty(PICTURE);
        // Without a bus there is nobody to tell.
        let _ = pipeline.post_message(gst::message::Application::new(picture));
    }
    gst::PadProbeReturn::Remove
}

#[cfg(test)]
mod tests {
    use super::*;

    const TAIL: &str = "; it is tried again until it is back";

    fn teller() -> Teller<Vec<u8>, Vec<u8>> {
        gst::init().unwrap();
        Teller::new(Rc::new(LogIn::new("plugh")), Vec::new(), Vec::new(), Duration::ZERO)
    }

    /// Another begins, with a source and a sink.
    fn begin(teller: &mut Teller<Vec<u8>, Vec<u8>>) -> gst::Pipeline {
        teller.next_run();
        let text = "rtspsrc location=rtsp://operator:xyzzy@camera/none filesink location=/none/a.mkv";
        let pipeline = gst::parse::launch(text).unwrap().downcast::<gst::Pipeline>().unwrap();
        teller.watch(&pipeline);
        pipeline
    }

    fn element(pipeline: &gst::Pipeline, factory: &str) -> gst::Element {
        let mut elements = pipeline.iterate_elements().into_iter().flatten();
        elements.find(|element| element.factory().is_some_and(|it| it.name() == factory)).unwrap()
    }

    fn error(element: &gst::Element, error: impl MessageErrorDomain, text: &str) -> gst::Message {
        gst::message::Error::builder(error, text).src(element).build()
    }

    fn warning(element: &gst::Element, text: &str) -> gst::Message {
        gst::message::Warning::builder(gst::ResourceError::Write, text).src(element).build()
    }

    fn camera(change: &str) -> gst::Message {
        gst::message::Element::new(gst::Structure::builder("ptztrack-camera").field("change", change).build())
    }

    fn picture() -> gst::Message {
        gst::message::Application::new(gst::Structure::new_empty(PICTURE))
    }

    /// What was told since it was last asked.
    fn told(stream: &mut Vec<u8>) -> Vec<String> {
        String::from_utf8(std::mem::take(stream)).unwrap().lines().map(str::to_owned).collect()
    }

    /// Pictures are gone, for one reason and another, and come back.
    fn outage(teller: &mut Teller<Vec<u8>, Vec<u8>>) -> Vec<String> {
        for reason in ["Not found", "Not found", "Could not read.", "Not found"] {
            let source = element(&begin(teller), "rtspsrc");
            teller.hear(&error(&source, gst::ResourceError::NotFound, reason));
            teller.hear(&error(&source, gst::StreamError::Failed, "what follows from it"));
        }
        for _ in 0..2 {
            begin(teller);
            teller.hear(&gst::message::Error::new(gst::ResourceError::OpenRead, "nobody is there"));
        }
        begin(teller);
        (0..2).for_each(|_| teller.hear(&picture()));
        told(&mut teller.err)
    }

    #[test]
    fn a_fault_is_told_once_and_so_is_its_end() {
        let mut teller = teller();
        let expected = [
            "ERROR: rtsp://camera/none: the stream has ended; it is tried again until it is back",
            "ERROR: rtsp://camera/none: Not found. Check the address, the cable and the camera; it is tried again until it is back",
            "ERROR: rtsp://camera/none: Could not read. Check the address, the cable and the camera; it is tried again until it is back",
            "ERROR: nobody is there; it is tried again until it is back",
            "INFO: the picture is there",
        ];
        assert_eq!(outage(&mut teller), expected[1..]);
        assert_eq!(outage(&mut teller), expected, "the pipeline with a picture ended by itself");
    }

    /// As where a disk is full: each pipeline has a picture, and fails.
    #[test]
    fn a_fault_that_comes_and_goes_is_told_once_in_a_while() {
        let mut teller = Teller { quiet: Duration::from_secs(3600), ..teller() };
        assert_eq!(outage(&mut teller).last().unwrap(), "INFO: the picture is there");
        for _ in 0..10 {
            let sink = element(&begin(&mut teller), "filesink");
            teller.hear(&error(&sink, gst::ResourceError::NoSpaceLeft, "no space left"));
            teller.hear(&picture());
        }
        let lines = told(&mut teller.err);
        let count = |text: &str| lines.iter().filter(|line| line.contains(text)).count();
        assert_eq!((count("no space left"), count("the picture is there")), (1, 1), "{lines:?}");
        // Where it stays, it is told as soon as it may be.
        teller.quiet = Duration::ZERO;
        let sink = element(&begin(&mut teller), "filesink");
        teller.hear(&error(&sink, gst::ResourceError::NoSpaceLeft, "no space left"));
        assert_eq!(told(&mut teller.err).len(), 1);
    }

    #[test]
    fn each_warning_of_a_pipeline_is_told_and_those_of_the_next_only_where_they_are_others() {
        let mut teller = teller();
        let say = |text: &str, teller: &mut Teller<_, _>| {
            let pipeline = begin(teller);
            // As two sinks do, of two cameras.
            (0..2).for_each(|_| teller.hear(&warning(&element(&pipeline, "filesink"), text)));
            told(&mut teller.err).iter().filter(|line| line.ends_with(text)).count()
        };
        assert_eq!(
            ["refused", "refused", "late", "refused"].map(|text| say(text, &mut teller)),
            [2, 0, 2, 0]
        );
        teller.hear(&picture());
        // They will not be said again by those who go on.
        assert_eq!(told(&mut teller.err).iter().filter(|line| line.ends_with("refused")).count(), 2);
        let pipeline = begin(&mut teller);
        teller.hear(&picture());
        told(&mut teller.err);
        for _ in 0..2 {
            teller.hear(&warning(&element(&pipeline, "filesink"), "frozen"));
        }
        assert_eq!(told(&mut teller.err).len(), 2, "an hour may be between them");
    }

    /// A camera that lets itself be steered, and sends no pictures.
    #[test]
    fn what_is_no_fault_waits_for_the_picture() {
        let mut teller = teller();
        begin(&mut teller);
        teller.hear(&camera("connected"));
        assert_eq!(told(&mut teller.out).len(), 1);
        for _ in 0..3 {
            begin(&mut teller);
            ["disconnected", "connected"].iter().for_each(|change| teller.hear(&camera(change)));
        }
        assert!(teller.out.is_empty());
        teller.hear(&picture());
        teller.hear(&camera("moving"));
        let told = told(&mut teller.out);
        let expected = ["disconnected", "connected", "moving"];
        assert!(
            told.len() == 3 && told.iter().zip(expected).all(|(line, word)| line.contains(word)),
            "{told:?}"
        );
    }

    #[test]
    fn a_refusal_is_told_once_and_not_that_it_is_tried_again() {
        let mut teller = teller();
        let pipeline = begin(&mut teller);
        let source = element(&pipeline, "rtspsrc");
        teller.hear(&error(&source, gst::ResourceError::NotAuthorized, "Unauthorized"));
        assert!(teller.err.is_empty());
        teller.end(&Err("Unauthorized".into()));
        let last = "Not restarted: it would fail in the same way.";
        let expected = ["ERROR: rtsp://camera/none: Unauthorized. Check user and password", last];
        assert_eq!(told(&mut teller.err), expected);

        let pipeline = begin(&mut teller);
        told(&mut teller.err);
        teller.hear(&warning(&element(&pipeline, "filesink"), "the camera refuses you."));
        teller.end(&Err("the camera refuses you.".into()));
        let told = told(&mut teller.err);
        assert!(told.len() == 2 && told[0].starts_with("WARNING") && told[1] == last, "{told:?}");
    }

    #[test]
    fn a_file_that_cannot_be_written_is_one_fault_whatever_number_it_has() {
        let mut teller = teller();
        for run in 1..20 {
            let sink = element(&begin(&mut teller), "filesink");
            let text = format!("no `a{}.mkv`", run_suffix(run));
            teller.hear(&error(&sink, gst::ResourceError::OpenWrite, &text));
        }
        assert_eq!(told(&mut teller.err), [format!("ERROR: filesink: no `a.mkv`{TAIL}")]);
    }

    #[test]
    fn a_silence_is_told_by_the_address_and_what_is_remembered_has_an_end() {
        let mut teller = teller();
        let pipeline = begin(&mut teller);
        let watchdog = gst::ElementFactory::make("watchdog").property("timeout", 1200).build().unwrap();
        pipeline.add(&watchdog).unwrap();
        teller.hear(&error(&watchdog, gst::StreamError::Failed, "Watchdog triggered"));
        let expected = format!("ERROR: rtsp://camera/none: nothing came for 1200 ms. {ADVICE}{TAIL}");
        assert_eq!(told(&mut teller.err), [expected]);
        for nth in 0..1000 {
            begin(&mut teller);
            teller.hear(&warning(&watchdog, &format!("{nth}")));
            (0..2).for_each(|_| teller.hear(&camera("connected")));
        }
        (0..1000).for_each(|_| teller.hear(&camera("connected")));
        assert!(teller.said.len() <= MOST_SAID && teller.held.len() <= MOST_SAID);
    }

    /// Whether the pipeline says that a picture has come.
    fn has_picture(text: &str) -> bool {
        let pipeline = gst::parse::launch(text).unwrap().downcast::<gst::Pipeline>().unwrap();
        teller().watch(&pipeline);
        pipeline.set_state(gst::State::Playing).unwrap();
        let bus = pipeline.bus().unwrap();
        let until = [gst::MessageType::Application, gst::MessageType::Eos];
        let first = bus.timed_pop_filtered(gst::ClockTime::from_seconds(60), &until).unwrap();
        pipeline.set_state(gst::State::Null).unwrap();
        first.type_() == gst::MessageType::Application
    }

    #[test]
    fn packets_are_no_picture() {
        gst::init().unwrap();
        assert!(has_picture("fakesrc num-buffers=1 ! fakesink"));
        assert!(!has_picture("fakesrc num-buffers=1 ! application/x-rtp ! fakesink"));
        // Whoever passes packets on has no other.
        assert!(has_picture("fakesrc num-buffers=1 ! application/x-rtp ! filesink location=/dev/null"));
        assert!(!has_picture("fakesrc num-buffers=0 ! fakesink"));
    }
}
