// SPDX-License-Identifier: MPL-2.0

//! Logging in for a pipeline that names users: the elements of ours are given the password, and GStreamer's sources are given
//! pictures, but no password, as they would tell it to anybody who asks for it in the camera's place.

use std::error::Error;
use std::sync::PoisonError;
use std::time::Duration;

use gst::prelude::*;
use session::http::{
    Authentication, ClientSettings, Credentials, Location, Secret, Trust, without_user_info,
};
use url::Url;

use crate::reach::ADVICE;
use crate::video::{Ended, Failure, LONGEST_SILENCE, Video};

/// Logs in for one pipeline after the other.
#[derive(Debug)]
pub struct LogIn {
    password: String,
    /// Of the pipeline before.
    ended: Ended,
}

impl LogIn {
    /// With the password of whatever user an element names.
    pub fn new(password: impl Into<String>) -> Self {
        Self { password: password.into(), ended: Ended::default() }
    }

    /// Gives the password to our sinks with a `user`. A `souphttpsrc` or `rtspsrc` with a `user-id` gets its pictures from here, and
    /// is without it then: an `appsrc` takes the place of the first. `auth`, `ca-file` and `insecure` are those of the sink.
    ///
    /// # Errors
    /// [`Failure`] where there are no pictures, or the pipeline before ended as user and password are refused.
    pub fn apply(&self, pipeline: &gst::Pipeline) -> Result<(), Box<dyn Error>> {
        let ended = self.ended.lock().unwrap_or_else(PoisonError::into_inner).take();
        if let Some(refused) = ended.filter(|ended| ended.refused) {
            return Err(refused.into());
        }
        let elements: Vec<_> = pipeline.iterate_recurse().into_iter().flatten().collect();
        let security = elements.iter().find(|element| is_ours(element)).map(security).unwrap_or_default();
        for element in &elements {
            let factory = element.factory().map(|factory| factory.name().to_string()).unwrap_or_default();
            if let Some(user) = text(element, "user-id")
                && matches!(factory.as_str(), "souphttpsrc" | "rtspsrc")
            {
                self.open(element, &user, security.clone())?;
            } else if text(element, "user").is_some() && is_ours(element) {
                element.set_property("password", &self.password);
            }
        }
        Ok(())
    }

    /// What ended the pictures of the pipeline that runs, where that is known better than an element can say.
    pub fn ended(&self) -> Option<Failure> {
        self.ended.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    fn open(
        &self,
        source: &gst::Element,
        user: &str,
        (authentication, trust): (Authentication, Trust),
    ) -> Result<(), Box<dyn Error>> {
        let location = text(source, "location").unwrap_or_default();
        let shown = without_user_info(&location);
        let mut url = Url::parse(&location).map_err(|err| format!("`{shown}` is no address: {err}"))?;
        // Who names a user beside the address logs in as that one.
        if url.set_username("").and_then(|()| url.set_password(None)).is_err() {
            return Err(format!("`{shown}` names no host").into());
        }
        let target = url[url::Position::BeforePath..].to_owned();
        let origin = url[..url::Position::BeforePath].to_owned();
        let host = url.host_str().unwrap_or_default();
        let by_rtsp = url.scheme().starts_with("rtsp");
        let settings = ClientSettings {
            // RTSP goes by its own address, below.
            location: Location::parse(&if by_rtsp { format!("http://{host}") } else { origin.clone() })?.0,
            channel: String::new(),
            credentials: Some(Credentials { user: user.to_owned(), password: Secret::new(&self.password) }),
            authentication,
            timeout: LONGEST_SILENCE,
            trust,
        };
        source.set_property("user-id", None::<&str>);
        if by_rtsp {
            let found = move || async move { Ok((origin, target)) };
            Video::rtsp(&source.name(), settings, found, Duration::ZERO, self.ended.clone())
                .map_err(|failure| Failure { reason: format!("{failure}. {ADVICE}"), ..failure })?
                .connect(source);
        } else {
            let video = Video::http(&source.name(), settings, target)?;
            video.connect(&in_place_of(source)?);
        }
        Ok(())
    }
}

/// Whether it is a sink of ours; others have users too, of whatever they speak to, but no watchdog.
fn is_ours(element: &gst::Element) -> bool {
    element.has_property_with_type("dead-man", glib::Type::BOOL)
}

/// How the sink proves who we are, and whom it believes.
fn security(sink: &gst::Element) -> (Authentication, Trust) {
    let basic = glib::EnumValue::from_value(&sink.property_value("auth"))
        .is_some_and(|(_, auth)| auth.nick() == "basic");
    let authentication = if basic { Authentication::Basic } else { Authentication::Auto };
    let trust = match (sink.property("insecure"), text(sink, "ca-file")) {
        (true, _) => Trust::Anyone,
        (false, Some(file)) => Trust::Authority(file.into()),
        (false, None) => Trust::System,
    };
    (authentication, trust)
}

/// An `appsrc` where the other was, before whatever it was linked to.
fn in_place_of(source: &gst::Element) -> Result<gst::Element, Box<dyn Error>> {
    let bin = source.parent().and_downcast::<gst::Bin>().ok_or("a source outside of a pipeline")?;
    let next = source.static_pad("src").and_then(|pad| pad.peer());
    let name = source.name();
    bin.remove(source)?;
    let fed = gst::ElementFactory::make("appsrc")
        .name(name)
        .property("is-live", true)
        .property("do-timestamp", true);
    let fed = fed.property_from_str("format", "time").build()?;
    bin.add(&fed)?;
    if let (Some(pad), Some(next)) = (fed.static_pad("src"), next) {
        pad.link(&next)?;
    }
    Ok(fed)
}

fn text(element: &gst::Element, property: &str) -> Option<String> {
    let known = element.has_property_with_type(property, glib::Type::STRING);
    let text = known.then(|| element.property::<Option<String>>(property)).flatten();
    text.filter(|text| !text.is_empty())
}

#[cfg(test)]
mod tests {
    use std::io::{Read, Write};
    use std::net::TcpListener;

    use super::*;

    /// A user and a password in an address reach no message: whoever reads the journal would know them.
    #[test]
    fn an_address_is_told_without_the_password_in_it() {
        gst::init().unwrap();
        for scheme in ["rtsp", "http"] {
            for rest in [":xyzzy@", ":xyzzy@camera:notaport/video", ":xyzzy@[/"] {
                let source = if scheme == "http" { "souphttpsrc" } else { "rtspsrc" };
                let pipeline = gst::Pipeline::new();
                let element = gst::ElementFactory::make(source).name("source").build().unwrap();
                element.set_property("user-id", "operator");
                element.set_property("location", format!("{scheme}://operator{rest}"));
                pipeline.add(&element).unwrap();
                let said = LogIn::new("plugh").apply(&pipeline).unwrap_err().to_string();
                assert!(!said.contains("xyzzy") && !said.is_empty(), "{said}");
            }
        }
    }

    /// Others have users too, of whatever they speak to.
    #[test]
    fn only_our_sinks_are_given_the_password() {
        gst::init().unwrap();
        let pipeline = gst::Pipeline::new();
        let other = gst::ElementFactory::make("curlhttpsink").property("user", "operator").build().unwrap();
        pipeline.add(&other).unwrap();
        LogIn::new("plugh").apply(&pipeline).unwrap();
        assert_eq!(text(&other, "passwd"), None);
    }

    /// Whoever answers in a camera's place and asks for Basic.
    fn stranger(protocol: &'static str) -> (String, std::sync::mpsc::Receiver<String>) {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap().to_string();
        let (hears, heard) = std::sync::mpsc::channel();
        std::thread::spawn(move || {
            for mut client in listener.incoming().map_while(Result::ok) {
                let mut bytes = [0; 4096];
                while let Ok(read @ 1..) = client.read(&mut bytes) {
                    let _ = hears.send(String::from_utf8_lossy(&bytes[..read]).into_owned());
                    let answer = format!(
                        "{protocol} 401 Unauthorized\r\nCSeq: 1\r\nWWW-Authenticate: Basic realm=\"AXIS\"\r\nContent-Length: 0\r\n\r\n"
                    );
                    let _ = client.write_all(answer.as_bytes());
                }
            }
        });
        (address, heard)
    }

    #[test]
    fn who_asks_for_the_password_in_clear_does_not_get_it_and_the_pipeline_shows_it_to_nobody() {
        gst::init().unwrap();
        for (protocol, source, scheme) in
            [("HTTP/1.1", "souphttpsrc", "http"), ("RTSP/1.0", "rtspsrc", "rtsp")]
        {
            let (address, heard) = stranger(protocol);
            let text = format!(
                "{source} name=source user-id=operator location={scheme}://{address}/video?a=b ! fakesink"
            );
            let pipeline = gst::parse::launch(&text).unwrap().downcast::<gst::Pipeline>().unwrap();
            let opened = LogIn::new("xyzzy-plugh").apply(&pipeline);
            if scheme == "http" {
                let failure = opened.unwrap_err().downcast::<Failure>().unwrap();
                assert!(!failure.refused && failure.reason.contains("Basic"), "{failure}");
            } else {
                opened.unwrap();
                // The relay is there, and nobody knows of the password.
                let location: String = pipeline.by_name("source").unwrap().property("location");
                assert!(
                    location.starts_with("rtsp://127.0.0.1:") && location.ends_with("/video?a=b"),
                    "{location}"
                );
                pipeline.set_state(gst::State::Playing).unwrap();
                let error = [gst::MessageType::Error];
                let bus = pipeline.bus().unwrap();
                assert!(bus.timed_pop_filtered(gst::ClockTime::from_seconds(60), &error).is_some());
                pipeline.set_state(gst::State::Null).unwrap();
            }
            let said: String = heard.try_iter().collect();
            assert!(said.contains("/video?a=b") && !said.contains("Authorization"), "{said}");
            let graph = pipeline.debug_to_dot_data(gst::DebugGraphDetails::all());
            assert!(graph.contains("source") && !graph.contains("xyzzy"), "{graph}");
        }
    }

    /// Of a pipeline that does not take it for pictures in parts.
    #[test]
    fn a_stream_of_another_kind_passes_as_it_is() {
        gst::init().unwrap();
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap();
        std::thread::spawn(move || {
            for mut client in listener.incoming().map_while(Result::ok) {
                if client.read(&mut [0; 4096]).is_ok_and(|read| read > 0) {
                    let head = b"HTTP/1.1 200 OK\r\nContent-Type: video/x-flv\r\nContent-Length: 5\r\n\r\n";
                    let _ = client.write_all(&[&head[..], b"FLV--"].concat());
                }
            }
        });
        let text = format!(
            "souphttpsrc name=source user-id=operator location=http://{address}/video ! appsink name=out sync=false"
        );
        let pipeline = gst::parse::launch(&text).unwrap().downcast::<gst::Pipeline>().unwrap();
        LogIn::new("plugh").apply(&pipeline).unwrap();
        pipeline.set_state(gst::State::Playing).unwrap();
        let out = pipeline.by_name("out").unwrap().downcast::<gst_app::AppSink>().unwrap();
        let sample = out.try_pull_sample(gst::ClockTime::from_seconds(60)).unwrap();
        assert_eq!(sample.buffer().unwrap().map_readable().unwrap().as_slice(), b"FLV--");
        pipeline.set_state(gst::State::Null).unwrap();
    }
}
