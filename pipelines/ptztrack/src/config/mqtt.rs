// SPDX-License-Identifier: MPL-2.0

use session::http::Trust;

use super::credentials::{self, Credentials};
use super::table::{Read, Table, whole};

/// The broker that is told what happens.
#[derive(Debug, Clone, PartialEq)]
pub struct Mqtt {
    pub host: String,
    pub port: u16,
    /// Whose certificates are believed; `None`: it is spoken to in clear.
    pub tls: Option<Trust>,
    pub credentials: Option<Credentials>,
    /// What all topics of ours begin with.
    pub topic: String,
    /// Home Assistant's prefix of discovery; `None` where it is not to be told.
    pub discovery: Option<String>,
}

impl Mqtt {
    /// MQTT without TLS and with it, as IANA has them.
    const PORT: u16 = 1883;
    const TLS_PORT: u16 = 8883;

    /// `None` where it is mistaken.
    pub(super) fn read(mut table: Table) -> Option<Result<Self, String>> {
        let host: Option<String> = table.need("host");
        let port = table.get_with("port", "a port, a whole number from 1 to 65535", |value| {
            whole(value).and_then(|port| u16::try_from(port).ok()).filter(|port| *port > 0)
        });
        let tls = tls(&mut table);
        let credentials = credentials::read(&mut table);
        let topic = topic(&mut table, "topic").unwrap_or_else(|| "ptztrack".to_owned());
        let prefix =
            self::topic(&mut table, "discovery-prefix").unwrap_or_else(|| "homeassistant".to_owned());
        let discovery = table.get("discovery").unwrap_or(true).then_some(prefix);
        table.no_more();
        let port = port.unwrap_or(if tls.is_some() { Self::TLS_PORT } else { Self::PORT });
        let host = host?;
        let this = credentials.map(|credentials| Self { host, port, tls, credentials, topic, discovery });
        Some(this.and_then(|this| this.check_certificates().map(|()| this)))
    }

    /// # Errors
    /// Why the certificates that are to be believed are of no use; they may be later.
    fn check_certificates(&self) -> Result<(), String> {
        let Some(trust) = &self.tls else { return Ok(()) };
        trust.client_config(true).map(|_| ()).map_err(|err| err.to_string())
    }
}

fn tls(table: &mut Table) -> Option<Trust> {
    let wanted = table.get("tls").unwrap_or(false);
    let authority = table.get::<String>("ca-file");
    if authority.is_some() && !wanted {
        table.wrong("`ca-file` is for a broker with `tls = true`");
    }
    wanted.then(|| authority.map_or(Trust::System, |file| Trust::Authority(file.into())))
}

/// The beginning of topics (MQTT 3.1.1, 4.7): no wildcards, and no `$`, which is the broker's own.
fn topic(table: &mut Table, key: &'static str) -> Option<String> {
    table.get_with(key, "the beginning of a topic, without `+`, `#`, `$` and `/` at its ends", |value| {
        String::read(value)
            .filter(|topic| !topic.contains(['+', '#', '$', '\0']) && topic.trim_matches('/') == topic)
    })
}
