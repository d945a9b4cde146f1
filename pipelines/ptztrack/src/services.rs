// SPDX-License-Identifier: MPL-2.0

//! What runs beside the cameras: page, MQTT and RTSP, each once it can be started.

use std::sync::Arc;
use std::time::Duration;

use tokio::sync::mpsc;
use tokio::task::JoinHandle;

use crate::config::{Config, Http, Mqtt};
use crate::event::{Event, Level};
use crate::fleet::Fleet;
use crate::handover::{Exchange, Message};
use crate::http::{self, Events};
use crate::log::Log;
use crate::mqtt::{Exchanging, Publisher};
use crate::restream::Restreaming;
use crate::shard::Shard;

/// Between two tries to have the page's address.
const LISTEN_AGAIN: Duration = Duration::from_secs(5);

/// What other processes are to be told.
pub type Saying = mpsc::Receiver<Message>;

pub struct Services {
    shard: Option<Shard>,
    fleet: Arc<Fleet>,
    log: Arc<Log>,
    page: Option<(Http, JoinHandle<()>)>,
    publisher: Option<Publisher>,
    /// With the other processes that share the cameras, until there is a broker.
    exchange: Option<(Arc<Exchange>, Saying)>,
    exchanging: Option<Exchanging>,
    /// Whoever ends does that on a thread of its own.
    pub restreaming: Option<Restreaming>,
}

impl Services {
    pub fn new(
        shard: Option<Shard>,
        exchange: Option<(Arc<Exchange>, Saying)>,
        fleet: Arc<Fleet>,
        log: Arc<Log>,
    ) -> Self {
        Self { shard, fleet, log, page: None, publisher: None, exchange, exchanging: None, restreaming: None }
    }

    /// Starts those that can be started and do not run.
    pub fn start(&mut self, config: &Config) {
        self.start_page(config);
        if let Ok(Some(mqtt)) = &config.mqtt {
            self.start_mqtt(mqtt, config);
        }
        self.start_restreaming(config);
    }

    /// What counts now; those that wait for something are started where it is there.
    pub fn change(&mut self, config: &Config) {
        self.restreaming.iter().for_each(|restreaming| restreaming.change(&config.cameras));
        self.start(config);
    }

    /// Without the password that there should be, it runs for the sake of `/healthz`, and is another one once that is there.
    fn start_page(&mut self, config: &Config) {
        if self.page.as_ref().map(|(http, _)| http) == config.http.as_ref() {
            return;
        }
        let before = self.page.take().map(|(_, page)| page);
        before.iter().for_each(JoinHandle::abort);
        let Some(http) = config.http.clone() else { return };
        let (fleet, log, settings) = (self.fleet.clone(), self.log.clone(), http.clone());
        let events = Events::of(config, log.clone());
        let page = tokio::spawn(async move {
            if let Some(before) = before {
                // It has the address until then.
                let _ = before.await;
            }
            serve(settings, fleet, events, log).await;
        });
        self.page = Some((http, page));
    }

    fn start_mqtt(&mut self, mqtt: &Mqtt, config: &Config) {
        let log = &self.log;
        if self.publisher.is_none() {
            let pictures = config.store.what.is_some_and(|kept| kept.pictures);
            let started = Publisher::start(mqtt, self.shard, pictures, self.fleet.clone(), log.clone());
            let tell = |err: &session::Error| log.error("mqtt-not-started", format!("no MQTT: {err}"));
            self.publisher = started.inspect_err(tell).ok();
        }
        if let Some((exchange, saying)) = self.exchange.take() {
            let started = Exchanging::start(mqtt, exchange, saying, log.clone());
            let tell = |err: &session::Error| {
                log.error(
                    "not-handing-over",
                    format!("nobody is handed over to or from other processes: {err}"),
                );
            };
            self.exchanging = started.inspect_err(tell).ok();
        }
    }

    fn start_restreaming(&mut self, config: &Config) {
        let Ok(Some(restream)) = &config.restream else { return };
        if self.restreaming.is_some() {
            return;
        }
        let started = Restreaming::start(restream, &config.cameras, self.fleet.clone(), self.log.clone());
        let tell = |reason: &String| {
            let detail = format!("nothing is passed on by RTSP: {reason}");
            self.log.tell(&Event::new(Level::Warning, None, "not-restreaming", detail));
        };
        self.restreaming = started.inspect_err(tell).ok();
    }

    /// Says to the broker that we are gone.
    pub async fn end(self) {
        self.exchanging.iter().for_each(Exchanging::end);
        if let Some(publisher) = self.publisher {
            publisher.end().await;
        }
    }
}

/// Nobody is followed the worse for a page that is not there: it is tried again.
async fn serve(http: Http, fleet: Arc<Fleet>, events: Events, log: Arc<Log>) {
    let mut told = false;
    let listener = loop {
        match http::listen(&http).await {
            Ok(listener) => break listener,
            Err(err) if !std::mem::replace(&mut told, true) => {
                log.error(
                    "not-listening",
                    format!("cannot listen on {}: {err}; it is tried again", http.listen),
                );
            }
            Err(_) => {}
        }
        tokio::time::sleep(LISTEN_AGAIN).await;
    };
    if let Ok(address) = listener.local_addr() {
        let what = if http.credentials.is_ok() {
            "page, /metrics and"
        } else {
            "until its password can be read, only"
        };
        log.info("listening", format!("{what} /healthz at http://{address}/"));
    }
    http::serve(listener, &http, fleet, events, log).await;
}
