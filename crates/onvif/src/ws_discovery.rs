// SPDX-License-Identifier: MPL-2.0

//! WS-Discovery: who is there? (OASIS WS-Discovery 2005; ONVIF Core, section 7.)

use std::net::{Ipv4Addr, SocketAddrV4};

use crate::soap::Element;

/// Where cameras listen.
pub const GROUP: SocketAddrV4 = SocketAddrV4::new(Ipv4Addr::new(239, 255, 255, 250), 3702);

/// What a camera says of itself without being logged in to.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Announcement {
    /// The numbers of the questions that it says to answer.
    pub questions: Vec<String>,
    /// Addresses of its device service, as it tells them.
    pub addresses: Vec<String>,
    /// Make and model, where it tells them.
    pub name: String,
}

/// The question who is there.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Probe {
    /// Its number, which the answers to it repeat.
    pub id: String,
    /// As it is sent.
    pub message: String,
}

/// The question, with a number of its own.
pub fn probe() -> Probe {
    let mut id = [0; 16];
    // Where there are no random numbers, who asks from elsewhere may have the same one, and who is not asked can guess it.
    let _ = getrandom::fill(&mut id);
    numbered_probe(u128::from_be_bytes(id))
}

fn numbered_probe(id: u128) -> Probe {
    let hex = format!("{id:032x}");
    let uuid = format!("{}-{}-{}-{}-{}", &hex[..8], &hex[8..12], &hex[12..16], &hex[16..20], &hex[20..]);
    let id = format!("uuid:{uuid}");
    let message = format!(
        concat!(
            r#"<?xml version="1.0" encoding="UTF-8"?>"#,
            r#"<s:Envelope xmlns:s="http://www.w3.org/2003/05/soap-envelope""#,
            r#" xmlns:a="http://schemas.xmlsoap.org/ws/2004/08/addressing""#,
            r#" xmlns:d="http://schemas.xmlsoap.org/ws/2005/04/discovery""#,
            r#" xmlns:dn="http://www.onvif.org/ver10/network/wsdl"><s:Header>"#,
            "<a:MessageID>{}</a:MessageID><a:To>urn:schemas-xmlsoap-org:ws:2005:04:discovery</a:To>",
            "<a:Action>http://schemas.xmlsoap.org/ws/2005/04/discovery/Probe</a:Action></s:Header>",
            "<s:Body><d:Probe><d:Types>dn:NetworkVideoTransmitter</d:Types></d:Probe></s:Body></s:Envelope>"
        ),
        id
    );
    Probe { id, message }
}

impl Announcement {
    /// Whether it answers the question of this number. A datagram does not prove who sent it, but only who has heard the question knows
    /// its number.
    pub fn answers(&self, question: &str) -> bool {
        self.questions.iter().any(|answered| number(answered) == number(question))
    }
}

/// A message's number (WS-Addressing) without whatever stands before the number proper.
fn number(id: &str) -> String {
    id.rsplit(':').next().unwrap_or_default().to_ascii_lowercase()
}

/// Reads `ProbeMatches`; empty where the answer is none.
pub fn parse_announcements(text: &str) -> Vec<Announcement> {
    let Some(envelope) = Element::parse(text) else { return Vec::new() };
    let related = envelope.child("Header").into_iter().flat_map(|header| header.children("RelatesTo"));
    let questions: Vec<_> = related.take(4).map(|related| related.text().to_owned()).collect();
    let Some(matches) = envelope.find(&["Body", "ProbeMatches"]) else { return Vec::new() };
    let announcements = matches.children("ProbeMatch").map(|found| {
        let words = |name| found.child(name).map_or("", Element::text).split_whitespace();
        let scope = |kind: &str| {
            let prefix = format!("onvif://www.onvif.org/{kind}/");
            words("Scopes").find_map(|scope| Some(readable(scope.strip_prefix(&prefix)?)))
        };
        let (name, model) = (scope("name"), scope("hardware"));
        Announcement {
            questions: questions.clone(),
            addresses: words("XAddrs").take(16).map(ToOwned::to_owned).collect(),
            // Many tell the model as a part of the name.
            name: match (name, model) {
                (Some(name), Some(model)) if !name.contains(&model) => format!("{name} {model}"),
                (Some(name), _) => name,
                (None, model) => model.unwrap_or_default(),
            },
        }
    });
    announcements.take(64).collect()
}

/// Percent encoding undone, on one line, of a length for a table.
fn readable(text: &str) -> String {
    let decoded = percent_encoding::percent_decode_str(text).decode_utf8_lossy();
    decoded.chars().filter(|c| !c.is_control()).take(60).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// To the question of number 0xa1.
    fn answer(scopes: &str, addresses: &str) -> String {
        format!(
            "<e:Envelope xmlns:e='x' xmlns:d='y'><e:Header><e:RelatesTo>uuid:00000000-0000-0000-0000-0000000000a1</e:RelatesTo></e:Header><e:Body><d:ProbeMatches><d:ProbeMatch><d:Scopes>{scopes}</d:Scopes><d:XAddrs>{addresses}</d:XAddrs></d:ProbeMatch></d:ProbeMatches></e:Body></e:Envelope>"
        )
    }

    fn heard_by(text: &str, asking: u128) -> Vec<Announcement> {
        let id = numbered_probe(asking).id;
        parse_announcements(text).into_iter().filter(|found| found.answers(&id)).collect()
    }

    fn heard(text: &str) -> Vec<Announcement> {
        heard_by(text, 0xa1)
    }

    #[test]
    fn a_camera_says_who_and_where_it_is() {
        let scopes = "onvif://www.onvif.org/type/ptz onvif://www.onvif.org/name/AXIS%20P5512 onvif://www.onvif.org/hardware/P5512";
        let found = heard(&answer(scopes, "http://10.0.0.1/onvif/device_service http://[fe80::1]/x"));
        let expected = ["http://10.0.0.1/onvif/device_service", "http://[fe80::1]/x"];
        assert_eq!(
            (found[0].name.as_str(), found[0].addresses.as_slice()),
            ("AXIS P5512", &expected.map(str::to_owned)[..])
        );
        let named = |scopes: &str| heard(&answer(scopes, ""))[0].name.clone();
        assert_eq!(
            named("onvif://www.onvif.org/name/Dahua onvif://www.onvif.org/hardware/SD49"),
            "Dahua SD49"
        );
        assert_eq!(named("onvif://www.onvif.org/name/a%0a%1bb"), "ab");
        assert_eq!(named(""), "");
    }

    #[test]
    fn what_is_no_answer_is_left_aside() {
        for text in ["", "x", "<a/>", &numbered_probe(0xa1).message] {
            assert_eq!(heard(text), []);
        }
    }

    #[test]
    fn an_answer_to_another_question_is_not_heard() {
        let ours = answer("", "http://10.0.0.1/");
        assert_eq!(heard(&ours).len(), 1);
        assert_eq!(heard(&ours.replace("uuid:", "urn:uuid:").replace("a1<", "A1<")).len(), 1);
        assert_eq!(heard_by(&ours, 0xa2), []);
        for other in ["RelatedTo", "MessageID"] {
            assert_eq!(heard(&ours.replace("RelatesTo", other)), [], "it does not say to which");
        }
        assert_eq!(heard(&ours.replace("00000000-0000-0000-0000-0000000000a1", "")), []);
    }

    #[test]
    fn questions_are_told_apart_by_their_number() {
        assert!(numbered_probe(1).message.contains("uuid:00000000-0000-0000-0000-000000000001<"));
        assert!(Element::parse(&probe().message).is_some() && probe() != probe());
    }
}
