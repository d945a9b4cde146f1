// SPDX-License-Identifier: MPL-2.0

//! Messages in and out.

use base64::prelude::{BASE64_STANDARD, Engine};
use chrono::{DateTime, NaiveDateTime};
use roxmltree::{Document, Node};
use sha1::{Digest, Sha1};

/// What a client says of itself.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Token {
    pub user: String,
    digest: String,
    nonce: Vec<u8>,
    created: String,
}

/// A message taken apart.
pub(crate) struct Message<'a> {
    /// What is asked for.
    pub body: Node<'a, 'a>,
    pub token: Option<Token>,
}

impl<'a> Message<'a> {
    /// Takes a message apart; `None` where it is none.
    pub fn of(document: &'a Document<'a>) -> Option<Self> {
        let envelope = document.root_element();
        let part = |name: &str| envelope.children().find(|node| node.tag_name().name() == name);
        let body = part("Body")?.children().find(Node::is_element)?;
        let token = part("Header").and_then(|header| {
            let token = header.descendants().find(|node| node.tag_name().name() == "UsernameToken")?;
            let text = |name| Some(child(token, name)?.text()?.trim().to_owned());
            Some(Token {
                user: text("Username")?,
                digest: text("Password")?,
                nonce: BASE64_STANDARD.decode(text("Nonce")?).ok()?,
                created: text("Created")?,
            })
        });
        Some(Self { body, token })
    }
}

impl Token {
    /// Whether it was made with this password.
    pub fn knows(&self, password: &str) -> bool {
        let digest = Sha1::new().chain_update(&self.nonce).chain_update(&self.created).chain_update(password);
        BASE64_STANDARD.encode(digest.finalize()) == self.digest
    }

    /// By how many seconds its time is off from this.
    pub fn off_by_s(&self, now: DateTime<chrono::Utc>) -> i64 {
        let created =
            NaiveDateTime::parse_from_str(self.created.trim_end_matches('Z'), "%Y-%m-%dT%H:%M:%S%.f");
        created.map_or(i64::MAX, |created| (created.and_utc() - now).num_seconds().abs())
    }
}

/// The first child of this local name.
pub(crate) fn child<'a>(node: Node<'a, 'a>, name: &str) -> Option<Node<'a, 'a>> {
    node.children().find(|child| child.tag_name().name() == name)
}

/// A number in an attribute.
pub(crate) fn number(node: Node, attribute: &str) -> Option<f64> {
    node.attribute(attribute)?.trim().parse::<f64>().ok().filter(|number| number.is_finite())
}

/// An answer with this body; `prefixes`: by others than everybody uses.
pub(crate) fn envelope(body: &str, prefixes: bool) -> String {
    let envelope = format!(
        concat!(
            r#"<?xml version="1.0" encoding="UTF-8"?>"#,
            r#"<env:Envelope xmlns:env="http://www.w3.org/2003/05/soap-envelope""#,
            r#" xmlns:ter="http://www.onvif.org/ver10/error" xmlns:tt="http://www.onvif.org/ver10/schema""#,
            r#" xmlns:tds="http://www.onvif.org/ver10/device/wsdl" xmlns:trt="http://www.onvif.org/ver10/media/wsdl""#,
            r#" xmlns:tr2="http://www.onvif.org/ver20/media/wsdl""#,
            r#" xmlns:tptz="http://www.onvif.org/ver20/ptz/wsdl"><env:Body>{}</env:Body></env:Envelope>"#
        ),
        body
    );
    if !prefixes {
        return envelope;
    }
    let renamed =
        [("env:", "SOAP-ENV:"), ("tds:", "ns1:"), ("trt:", "ns2:"), ("tptz:", "ns3:"), ("tt:", "ns4:")];
    let declared = [
        ("xmlns:env", "xmlns:SOAP-ENV"),
        ("xmlns:tds", "xmlns:ns1"),
        ("xmlns:trt", "xmlns:ns2"),
        ("xmlns:tptz", "xmlns:ns3"),
        ("xmlns:tt", "xmlns:ns4"),
    ];
    declared.into_iter().chain(renamed).fold(envelope, |text, (from, to)| text.replace(from, to))
}

/// A fault.
pub(crate) fn fault(code: &str, reason: &str) -> String {
    format!(
        "<env:Fault><env:Code><env:Value>env:Sender</env:Value><env:Subcode><env:Value>ter:{code}</env:Value></env:Subcode></env:Code><env:Reason><env:Text xml:lang=\"en\">{reason}</env:Text></env:Reason></env:Fault>"
    )
}
