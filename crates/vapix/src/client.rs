// SPDX-License-Identifier: MPL-2.0

use std::time::Duration;

use servo::{HardLimits, Motion, Position, Presets};
use session::http::{Credentials, HttpClient, Identity, Repeat, unexpected};
use session::{
    Attributes, Command, Error, Parameters, Protocol, Query, QueuePlace, QueueRequest, Request, Response,
};

use crate::attributes::parse_attributes;
use crate::command::Words;
use crate::presets::parse_presets;
use crate::queue::{control, parse_queue_place};
use crate::text::{complaint, parse_limits, parse_move_speed, parse_parameters, parse_position};

/// HTTP's answer to a move that is accepted.
const NO_CONTENT: u16 = 204;

/// One camera. Every request takes `&mut self`: there is at most one in flight.
#[derive(Debug)]
pub struct Client {
    http: HttpClient,
}

impl session::Client for Client {
    const PROTOCOL: Protocol = Protocol {
        questions: &[Query::Position, Query::Limits, Query::Attributes, Query::Parameters, Query::MoveSpeed],
        keep_alive: Duration::from_secs(2),
        confirms_stops: false,
        has_control_queue: true,
    };

    fn in_place_of(identity: Identity) -> Result<Self, Error> {
        Ok(Self { http: HttpClient::in_place_of(identity)? })
    }

    fn identity(&self) -> Identity {
        self.http.identity()
    }

    fn set_credentials(&mut self, credentials: Option<Credentials>) {
        self.http.set_credentials(credentials);
    }

    async fn exchange(&mut self, request: &Request) -> Result<Response, Error> {
        match request {
            Request::Command(command) => self.send(command).await.map(|()| Response::Accepted),
            Request::Query(Query::Position) => self.position().await.map(Response::Position),
            Request::Query(Query::Limits) => self.limits().await.map(Response::Limits),
            Request::Query(Query::Parameters) => self.parameters().await.map(Response::Parameters),
            Request::Query(Query::Attributes) => self.attributes().await.map(Response::Attributes),
            Request::Query(Query::MoveSpeed) => self.move_speed().await.map(Response::MoveSpeed),
            Request::Query(Query::Presets) => self.presets().await.map(Response::Presets),
            Request::Query(Query::Queue(request)) => self.queue(*request).await.map(Response::Place),
        }
    }
}

impl Client {
    /// Its video channel, from 1.
    fn camera(&self) -> &str {
        &self.http.settings().channel
    }

    /// Commands a move. `Ok` means that the camera accepted it, not that it has finished.
    async fn send(&mut self, command: &Command) -> Result<(), Error> {
        let target = format!("/axis-cgi/com/ptz.cgi?camera={}&{}", self.camera(), Words(command));
        // Of these the second would go on from where the first led.
        let repeat = match command {
            Command::Stop(_) => Repeat::UntilHeard,
            Command::Move { motion: Motion::Centre { .. }, .. } => Repeat::Never,
            Command::Move { .. } => Repeat::WhereBroken,
        };
        let answer = self.http.get(&target, repeat).await?;
        match answer.status {
            NO_CONTENT => Ok(()),
            // 200 in answer to a move is a refusal, whatever it says.
            _ => Err(complaint(&answer.body).map_or_else(|| unexpected(&answer.body), Error::Camera)),
        }
    }

    /// Asks where the camera looks.
    async fn position(&mut self) -> Result<Position, Error> {
        parse_position(&self.query("position").await?)
    }

    /// Asks how far the camera can look.
    async fn limits(&mut self) -> Result<HardLimits, Error> {
        parse_limits(&self.query("limits").await?)
    }

    /// Asks for the camera's PTZ parameters.
    async fn parameters(&mut self) -> Result<Parameters, Error> {
        let answer = self.http.get("/axis-cgi/param.cgi?action=list&group=PTZ", Repeat::WhereBroken).await?;
        parse_parameters(&answer.body, self.camera())
    }

    /// Asks what the camera's steps mean.
    async fn attributes(&mut self) -> Result<Attributes, Error> {
        parse_attributes(&self.query("attributes").await?)
    }

    /// Asks how fast moves to a position are.
    async fn move_speed(&mut self) -> Result<f64, Error> {
        parse_move_speed(&self.query("speed").await?)
    }

    /// Asks which presets the camera has.
    async fn presets(&mut self) -> Result<Presets, Error> {
        parse_presets(&self.query("presetposcam").await?)
    }

    /// Asks for control where the camera has a control queue. `None`: accepted without a place.
    async fn queue(&mut self, request: QueueRequest) -> Result<Option<QueuePlace>, Error> {
        let target =
            format!("/axis-cgi/com/ptzqueue.cgi?control={}&camera={}", control(request), self.camera());
        let answer = self.http.get(&target, Repeat::WhereBroken).await?;
        let accepted = answer.status == NO_CONTENT;
        if accepted { Ok(None) } else { parse_queue_place(&answer.body).map(Some) }
    }

    async fn query(&mut self, what: &str) -> Result<String, Error> {
        let target = format!("/axis-cgi/com/ptz.cgi?camera={}&query={what}", self.camera());
        let answer = self.http.get(&target, Repeat::WhereBroken).await?;
        match complaint(&answer.body) {
            Some(text) => Err(Error::Camera(text)),
            None if answer.body.trim().is_empty() => Err(Error::NoPtz),
            None => Ok(answer.body),
        }
    }
}
