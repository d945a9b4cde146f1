// SPDX-License-Identifier: MPL-2.0

//! SOAP 1.2: envelopes, and what is in them.

use quick_xml::XmlVersion;
use quick_xml::escape::{escape, unescape};
use quick_xml::events::{BytesStart, Event};
use quick_xml::reader::Reader;
use session::Error;
use session::http::{CompleteResponse, excerpt, unexpected};

/// Deeper or longer answers are none: real ones have a dozen levels and some hundred elements.
const MAX_DEPTH: usize = 64;
const MAX_ELEMENTS: usize = 20_000;

/// An XML element; names are without their namespaces, as cameras choose other prefixes, and some of them the wrong namespace.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Element {
    name: String,
    attributes: Vec<(String, String)>,
    text: String,
    children: Vec<Self>,
}

/// What an answer says.
#[derive(Debug, Clone, PartialEq)]
pub enum Answer {
    /// The content of the body.
    Body(Element),
    /// The camera does not take us for who we say we are, or our time for the right one.
    NotAuthorized,
    /// The camera refuses, for this reason.
    Fault(String),
}

/// A message with this header and body, whose elements have the prefixes `tds`, `trt`, `tr2`, `tptz`, `tt`, `wsse` and `wsu`.
pub fn envelope(header: &str, body: &str) -> String {
    format!(
        concat!(
            r#"<?xml version="1.0" encoding="UTF-8"?>"#,
            r#"<s:Envelope xmlns:s="http://www.w3.org/2003/05/soap-envelope""#,
            r#" xmlns:tds="http://www.onvif.org/ver10/device/wsdl""#,
            r#" xmlns:trt="http://www.onvif.org/ver10/media/wsdl""#,
            r#" xmlns:tr2="http://www.onvif.org/ver20/media/wsdl""#,
            r#" xmlns:tptz="http://www.onvif.org/ver20/ptz/wsdl""#,
            r#" xmlns:tt="http://www.onvif.org/ver10/schema">"#,
            "<s:Header>{}</s:Header><s:Body>{}</s:Body></s:Envelope>"
        ),
        header, body
    )
}

/// Text as it may stand in a message.
pub fn escaped(text: &str) -> String {
    escape(text).into_owned()
}

/// Reads an answer, whatever its HTTP status: cameras send faults with 200, 400 and 500.
///
/// # Errors
/// [`Error::Status`] of an answer that is no success and no SOAP, [`Error::Unexpected`] of one that should be.
pub fn read_answer(answer: &CompleteResponse) -> Result<Answer, Error> {
    let body = Element::parse(&answer.body).and_then(|envelope| envelope.into_child("Body"));
    match body {
        Some(body) => Ok(body.find(&["Fault"]).map_or_else(|| Answer::Body(body.clone()), fault)),
        None if answer.status == 401 => Ok(Answer::NotAuthorized),
        None if !(200..300).contains(&answer.status) => {
            Err(Error::Status { status: answer.status, reason: "" })
        }
        None => Err(unexpected(&answer.body)),
    }
}

fn fault(fault: &Element) -> Answer {
    let mut codes = Vec::new();
    fault.gather("Value", &mut codes);
    // SOAP 1.1 has it otherwise.
    fault.gather("faultcode", &mut codes);
    let mut reasons = Vec::new();
    fault.gather("Text", &mut reasons);
    fault.gather("faultstring", &mut reasons);
    // Not all have a code for it: one that is asked again and again for this locks the account.
    let refuses_us = |text: &&str| {
        let text = text.to_ascii_lowercase();
        ["authoriz", "authenticat", "security"].iter().any(|word| text.contains(word))
    };
    if codes.iter().chain(&reasons).any(refuses_us) {
        return Answer::NotAuthorized;
    }
    let said: Vec<_> = reasons.into_iter().chain(codes.into_iter().next_back()).collect();
    let said = excerpt(&said.join(", "));
    Answer::Fault(if said.is_empty() { "a fault without a reason".to_owned() } else { said })
}

impl Element {
    /// The outermost element; `None` where that is no XML.
    pub fn parse(xml: &str) -> Option<Self> {
        let mut reader = Reader::from_str(xml);
        let mut open = vec![Self::default()];
        let mut elements = 0;
        loop {
            match reader.read_event().ok()? {
                Event::Start(start) => {
                    open.push(Self::begun(&start)?);
                    elements += 1;
                }
                Event::Empty(start) => {
                    open.last_mut()?.children.push(Self::begun(&start)?);
                    elements += 1;
                }
                Event::End(_) => {
                    let ended = open.pop()?;
                    open.last_mut()?.children.push(ended);
                }
                Event::Text(text) => open.last_mut()?.text.push_str(&text.decode().ok()?),
                Event::CData(text) => open.last_mut()?.text.push_str(&text.decode().ok()?),
                Event::GeneralRef(reference) => {
                    let name = reference.decode().ok()?;
                    open.last_mut()?.text.push_str(&unescape(&format!("&{name};")).ok()?);
                }
                Event::Eof => break,
                Event::Comment(_) | Event::Decl(_) | Event::PI(_) | Event::DocType(_) => {}
            }
            if open.len() > MAX_DEPTH || elements > MAX_ELEMENTS {
                return None;
            }
        }
        // One cut short has elements that were never ended.
        (open.len() == 1).then(|| open.pop()?.children.into_iter().next()).flatten()
    }

    fn begun(start: &BytesStart) -> Option<Self> {
        let local = |name: &[u8]| String::from_utf8(name.to_vec()).ok();
        // A name that comes twice is none of ours; to look for such takes time by the square of their number.
        let mut attributes = start.attributes();
        let attributes = attributes.with_checks(false).flatten().filter_map(|attribute| {
            let value = attribute.normalized_value(XmlVersion::Implicit1_0).ok()?.into_owned();
            Some((local(attribute.key.local_name().as_ref())?, value))
        });
        Some(Self {
            name: local(start.local_name().as_ref())?,
            attributes: attributes.collect(),
            ..Self::default()
        })
    }

    /// Its first child of this name.
    pub fn child(&self, name: &str) -> Option<&Self> {
        self.children.iter().find(|child| child.name == name)
    }

    fn into_child(self, name: &str) -> Option<Self> {
        self.children.into_iter().find(|child| child.name == name)
    }

    /// Its children of this name.
    pub fn children<'a>(&'a self, name: &'a str) -> impl Iterator<Item = &'a Self> {
        self.children.iter().filter(move |child| child.name == name)
    }

    /// What lies there, by the names on the way.
    pub fn find(&self, path: &[&str]) -> Option<&Self> {
        path.iter().try_fold(self, |element, name| element.child(name))
    }

    /// The value of one of its attributes.
    pub fn attribute(&self, name: &str) -> Option<&str> {
        self.attributes.iter().find(|(known, _)| known == name).map(|(_, value)| value.as_str())
    }

    /// Its text.
    pub fn text(&self) -> &str {
        self.text.trim()
    }

    /// A number in an attribute.
    pub fn number(&self, attribute: &str) -> Option<f64> {
        number(self.attribute(attribute)?)
    }

    /// The text of all that is called so within.
    fn gather<'a>(&'a self, name: &str, found: &mut Vec<&'a str>) {
        for child in &self.children {
            if child.name == name {
                found.push(child.text());
            }
            child.gather(name, found);
        }
    }
}

/// A finite number.
pub fn number(text: &str) -> Option<f64> {
    text.trim().parse::<f64>().ok().filter(|number| number.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn answer(status: u16, body: &str) -> Result<Answer, Error> {
        read_answer(&CompleteResponse { status, body: body.to_owned() })
    }

    #[test]
    fn prefixes_do_not_matter() {
        for prefix in ["", "SOAP-ENV:", "s:", "env:"] {
            let body = format!(
                "<{prefix}Envelope><{prefix}Body><x:A b='1'> t </x:A></{prefix}Body></{prefix}Envelope>"
            );
            let Ok(Answer::Body(body)) = answer(200, &body) else { panic!("{body}") };
            let found = body.find(&["A"]).unwrap();
            assert_eq!((found.text(), found.number("b")), ("t", Some(1.0)));
        }
    }

    #[test]
    fn faults_are_told_whatever_their_status() {
        let fault = |code: &str, reason: &str| {
            format!(
                "<E><Body><Fault><Code><Value>s:Sender</Value><Subcode><Value>{code}</Value></Subcode></Code><Reason><Text>{reason}</Text></Reason></Fault></Body></E>"
            )
        };
        for status in [200, 400, 500] {
            assert_eq!(answer(status, &fault("ter:NotAuthorized", "no")), Ok(Answer::NotAuthorized));
            let refused = answer(status, &fault("ter:NoProfile", "no such profile &amp; no other"));
            assert_eq!(refused, Ok(Answer::Fault("no such profile & no other, ter:NoProfile".to_owned())));
        }
        let old =
            "<E><Body><Fault><faultcode>ter:X</faultcode><faultstring>y</faultstring></Fault></Body></E>";
        assert_eq!(answer(500, old), Ok(Answer::Fault("y, ter:X".to_owned())));
    }

    #[test]
    fn what_is_no_soap_is_judged_by_its_status() {
        assert_eq!(answer(401, "<html>"), Ok(Answer::NotAuthorized));
        assert!(matches!(answer(503, ""), Err(Error::Status { status: 503, .. })));
        for body in ["", "<a>", "<a></b>", "<a/>", "pan=1"] {
            assert!(matches!(answer(200, body), Err(Error::Unexpected(_))), "{body}");
        }
    }

    #[test]
    fn a_text_is_escaped() {
        let text = "<&\">'";
        let read = Element::parse(&format!("<a>{}</a>", escaped(text))).unwrap();
        assert_eq!(read.text(), text);
    }

    proptest! {
        #[test]
        fn any_text_is_read_or_refused(body in "(</?[a-z:]{0,3}( a='1')?/?>|&[a-z#0-9]{0,4};|<!\\[CDATA\\[|\\]\\]>|.){0,40}") {
            let _ = answer(200, &body);
        }
    }

    #[test]
    fn depth_without_end_is_refused() {
        assert_eq!(Element::parse(&"<a>".repeat(100_000)), None);
    }
}
