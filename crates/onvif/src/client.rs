// SPDX-License-Identifier: MPL-2.0

use std::mem;
use std::time::Duration;

use servo::{Motion, Position, Presets};
use session::http::{Credentials, HttpClient, Identity, Repeat, excerpt, unexpected};
use session::{Command, Error, Protocol, Query, Request, Response, Stop};
use tokio::time::timeout;

use crate::abilities::{Abilities, MoveTimeout, Velocity, parse_abilities};
use crate::answers::{
    Profile, Services, parse_date, parse_position, parse_presets, parse_profiles, parse_services,
};
use crate::clock::CameraClock;
use crate::findings::Findings;
use crate::messages;
use crate::moves::{Moves, StopWords};
use crate::soap::{Answer, Element, envelope, read_answer};
use crate::streams::{Encoding, StreamAddress, VideoStream, parse_stream_address, parse_streams};
use crate::token::security;

/// Where the device service is where the location names no path (ONVIF Core, 5.1.1).
const DEVICE_SERVICE: &str = "/onvif/device_service";

/// A camera that does not say by then where it looks keeps moves waiting.
const STATUS_TIMEOUT: Duration = Duration::from_secs(1);

/// After so many questions for its position that it did not answer in time, it is not asked again.
const LATE_STATUSES: u32 = 2;

/// One camera.
#[derive(Debug)]
pub struct Client {
    http: HttpClient,
    identity: Identity,
    /// Path of its device service.
    device: String,
    /// Known once it was asked.
    clock: Option<CameraClock>,
    services: Option<Services>,
    profile: Option<Profile>,
    abilities: Option<Abilities>,
    /// Tokens of its presets, by their number less one.
    presets: Vec<String>,
    moves: Moves,
    login: Login,
    /// Questions for its position, in a row, that were not answered in time.
    late_statuses: u32,
    warning: Option<String>,
    /// What is known of it somebody else found out, and nothing was said by it yet.
    inherits: bool,
    /// Of what it can do no more is known than commands need that are not to wait: it is asked before the first question.
    lacks_abilities: bool,
}

/// What became of our user and password.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Login {
    /// They were not judged yet.
    Open,
    /// They were accepted for something.
    Accepted,
    /// They were refused: nothing more is sent, so that the account is not locked.
    Refused,
}

impl session::Client for Client {
    const PROTOCOL: Protocol = Protocol {
        questions: &[Query::Position, Query::Limits, Query::Attributes, Query::Parameters],
        // Twice within the timeout of a move.
        keep_alive: Duration::from_millis(800),
        confirms_stops: true,
        has_control_queue: false,
    };

    fn in_place_of(identity: Identity) -> Result<Self, Error> {
        let device = match identity.settings.location.path() {
            "" => DEVICE_SERVICE,
            path => path,
        };
        let device = device.to_owned();
        let mut own = identity.clone();
        own.settings.location = identity.settings.location.origin();
        let mut client = Self {
            http: HttpClient::in_place_of(own)?,
            device,
            clock: None,
            services: None,
            profile: None,
            abilities: None,
            presets: Vec::new(),
            moves: Moves::default(),
            login: if identity.accepted { Login::Accepted } else { Login::Open },
            late_statuses: 0,
            warning: None,
            inherits: false,
            lacks_abilities: false,
            identity,
        };
        // Of a camera that nothing is known of it is asked.
        if let Ok(findings) = serde_json::from_value(client.identity.findings.clone()) {
            client.know(findings);
        }
        Ok(client)
    }

    fn identity(&self) -> Identity {
        let mut identity = self.identity.clone();
        identity.accepted = self.login == Login::Accepted;
        identity.findings = serde_json::to_value(self.findings()).unwrap_or_default();
        identity
    }

    fn set_credentials(&mut self, credentials: Option<Credentials>) {
        self.identity.settings.credentials.clone_from(&credentials);
        self.http.set_credentials(credentials);
        self.login = Login::Open;
    }

    async fn exchange(&mut self, request: &Request) -> Result<Response, Error> {
        let answer = self.answer(request).await;
        if mem::take(&mut self.inherits) && answer.is_err() {
            // It may be otherwise than it was then.
            (self.clock, self.services, self.profile, self.abilities) = (None, None, None, None);
        }
        answer
    }

    fn take_warning(&mut self) -> Option<String> {
        self.warning.take()
    }
}

impl Client {
    async fn answer(&mut self, request: &Request) -> Result<Response, Error> {
        let mut abilities = self.connected().await?;
        if self.lacks_abilities && matches!(request, Request::Query(_)) {
            abilities = self.ask_abilities().await?;
        }
        match request {
            Request::Command(command) => {
                self.send(command, &abilities).await?;
                // Only by what it does is it known to have judged them: some let anybody ask.
                if self.login == Login::Accepted {
                    self.http.note_accepted();
                }
                Ok(Response::Accepted)
            }
            Request::Query(Query::Position) => self.position(&abilities).await.map(Response::Position),
            Request::Query(Query::Limits) => Ok(Response::Limits(abilities.limits())),
            Request::Query(Query::Parameters) => Ok(Response::Parameters(abilities.parameters())),
            Request::Query(Query::Attributes) => {
                let attributes = abilities.attributes();
                attributes
                    .map(Response::Attributes)
                    .ok_or_else(|| Error::Camera("speeds are not told".to_owned()))
            }
            Request::Query(Query::Presets) => self.presets().await.map(Response::Presets),
            Request::Query(Query::MoveSpeed | Query::Queue(_)) => {
                Err(Error::Camera("ONVIF has no words for this".to_owned()))
            }
        }
    }

    /// `None`: not everything is known yet.
    fn findings(&self) -> Option<Findings> {
        Some(Findings {
            services: self.services.clone()?,
            profile: self.profile.clone()?,
            timeout: self.abilities.as_ref()?.timeout,
            clock_ahead_s: self.clock?.ahead_s(),
            moves: self.moves.clone(),
        })
    }

    fn know(&mut self, findings: Findings) {
        let Findings { services, profile, timeout, clock_ahead_s, moves } = findings;
        (self.services, self.profile, self.moves) = (Some(services), Some(profile), moves);
        self.abilities = Some(Abilities::with_timeout(timeout));
        self.clock = Some(CameraClock::ahead_by(clock_ahead_s));
        (self.inherits, self.lacks_abilities) = (true, true);
    }

    /// Whether the camera turns, by its own word.
    ///
    /// # Errors
    /// Any.
    pub async fn has_ptz(&mut self) -> Result<bool, Error> {
        Ok(self.reached().await?.ptz.is_some())
    }

    /// Which video streams it has.
    ///
    /// # Errors
    /// Any.
    pub async fn streams(&mut self) -> Result<Vec<VideoStream>, Error> {
        let services = self.reached().await?;
        let mut streams = parse_streams(&self.call(Path::Media, messages::GET_PROFILES).await?);
        if services.media2.is_some() {
            // The only one that tells of H.265. Where it fails, the other is what there is.
            let body = self.call(Path::Media2, messages::GET_PROFILES_2).await.unwrap_or_default();
            streams
                .extend(parse_streams(&body).into_iter().filter(|stream| stream.encoding == Encoding::H265));
        }
        Ok(streams)
    }

    /// Where one of them is.
    ///
    /// # Errors
    /// Any.
    pub async fn stream_address(&mut self, stream: &VideoStream) -> Result<StreamAddress, Error> {
        let body = if stream.encoding == Encoding::H265 {
            self.call(Path::Media2, &messages::get_stream_uri_2(&stream.profile)).await?
        } else {
            self.call(Path::Media, &messages::get_stream_uri(&stream.profile)).await?
        };
        parse_stream_address(&body).ok_or_else(|| unexpected("no address of a stream by RTSP"))
    }

    /// Asks what anybody may know.
    async fn reached(&mut self) -> Result<Services, Error> {
        if self.clock.is_none() {
            self.clock = Some(self.ask_clock().await?);
        }
        if self.services.is_none() {
            let listed = match self.call(Path::Device, messages::GET_SERVICES).await {
                Ok(body) => parse_services(&body),
                // Some close the connection in place of a fault.
                Err(err) if err.is_answer() || matches!(err, Error::Status { .. } | Error::Broken(_)) => None,
                Err(err) => return Err(err),
            };
            let services = match listed {
                Some(services) if services.ptz.is_some() => Some(services),
                listed => match self.call(Path::Device, messages::GET_CAPABILITIES).await {
                    Ok(body) => parse_services(&body).or(listed),
                    Err(err) if listed.is_none() => return Err(err),
                    Err(_) => listed,
                },
            };
            self.services = Some(services.ok_or(Error::NoPtz)?);
        }
        self.services.clone().ok_or(Error::NoPtz)
    }

    /// Asks what has to be known before anything else can be said. What was answered is not asked again, so that a camera
    /// that is slow, or gone for a while, is got to know all the same.
    async fn connected(&mut self) -> Result<Abilities, Error> {
        if self.reached().await?.ptz.is_none() {
            return Err(Error::NoPtz);
        }
        if self.profile.is_none() {
            let profiles = parse_profiles(&self.call(Path::Media, messages::GET_PROFILES).await?);
            self.profile = Some(self.choose(profiles)?);
        }
        if let Some(abilities) = &self.abilities {
            return Ok(abilities.clone());
        }
        self.ask_abilities().await
    }

    /// What it can do. What was known before stays until it has answered.
    async fn ask_abilities(&mut self) -> Result<Abilities, Error> {
        let configuration = self.profile.as_ref().map_or("", |profile| &profile.configuration).to_owned();
        let options = messages::get_configuration_options(&configuration);
        let abilities = match self.call(Path::Ptz, &options).await {
            Ok(body) => {
                // By its own word.
                self.inherits = false;
                parse_abilities(&body)
            }
            // It may be moved all the same, by what is known.
            Err(err) if err.is_answer() || matches!(err, Error::Broken(_)) => {
                self.abilities.clone().unwrap_or_default()
            }
            Err(err) => return Err(err),
        };
        if abilities.timeout == MoveTimeout::Never {
            self.warn_of_no_timeout();
        }
        self.lacks_abilities = false;
        Ok(self.abilities.insert(abilities).clone())
    }

    fn choose(&self, profiles: Vec<Profile>) -> Result<Profile, Error> {
        let wanted = &self.http.settings().channel;
        let names: Vec<_> = profiles.iter().map(|profile| profile.token.clone()).collect();
        let is_wanted =
            |profile: &Profile| wanted.is_empty() || *wanted == profile.token || *wanted == profile.name;
        match profiles.into_iter().find(is_wanted) {
            Some(profile) => Ok(profile),
            None if names.is_empty() => Err(Error::NoPtz),
            None => Err(no_such_profile(wanted, &names)),
        }
    }

    /// Asked without saying who we are: whoever is refused for a wrong time learns the right one by it.
    async fn ask_clock(&mut self) -> Result<CameraClock, Error> {
        let message = envelope("", messages::GET_SYSTEM_DATE_AND_TIME);
        let answer = self.http.post(&self.device, &message, Repeat::WhereBroken).await?;
        Ok(match read_answer(&answer) {
            Ok(Answer::Body(body)) => {
                parse_date(&body).map_or_else(CameraClock::assumed, CameraClock::showing)
            }
            // It is there, and keeps its time to itself.
            _ => CameraClock::assumed(),
        })
    }

    /// The body of the answer to a message.
    async fn call(&mut self, path: Path, message: &str) -> Result<Element, Error> {
        self.say(path, message, Repeat::WhereBroken).await
    }

    async fn say(&mut self, path: Path, message: &str, repeat: Repeat) -> Result<Element, Error> {
        if self.login == Login::Refused {
            return Err(self.bad_credentials());
        }
        // What anybody may ask says nothing of our password.
        let open = path == Path::Device;
        let path = self.path(path).to_owned();
        for fresh in [false, true] {
            if fresh {
                self.clock = Some(self.ask_clock().await?);
            }
            // By HTTP's Digest it is known who we are; a camera that does not take that word for it is told in both ways.
            let tells = fresh || !open && !self.http.is_signing();
            let token = self.http.credentials().filter(|_| tells).cloned();
            let signed = self.http.is_signing();
            let judged = token.is_some() || signed;
            let header = token.map_or_else(String::new, |credentials| {
                security(&credentials, &self.clock.unwrap_or_else(CameraClock::assumed).now())
            });
            let answer = match self.http.post(&path, &envelope(&header, message), repeat).await {
                Ok(answer) => read_answer(&answer)?,
                // We were let in before, by a token alone: it may be for the time of that.
                Err(Error::NotPermitted { .. }) if !signed => {
                    self.login = Login::Accepted;
                    self.http.forget_challenge();
                    Answer::NotAuthorized
                }
                Err(err) => return Err(err),
            };
            match answer {
                Answer::Body(body) => {
                    if judged {
                        self.login = Login::Accepted;
                    }
                    return Ok(body);
                }
                Answer::Fault(reason) => return Err(Error::Camera(reason)),
                Answer::NotAuthorized if self.http.credentials().is_none() => {
                    return Err(Error::CredentialsMissing);
                }
                Answer::NotAuthorized => {}
            }
        }
        if self.login == Login::Accepted {
            return Err(Error::NotPermitted { user: self.user() });
        }
        self.login = Login::Refused;
        Err(self.bad_credentials())
    }

    fn path(&self, path: Path) -> &str {
        match (path, &self.services) {
            (Path::Media, Some(services)) => &services.media,
            (Path::Media2, Some(Services { media2: Some(media2), .. })) => media2,
            (Path::Ptz, Some(Services { ptz: Some(ptz), .. })) => ptz,
            _ => &self.device,
        }
    }

    fn user(&self) -> String {
        self.http.credentials().map_or_else(String::new, |credentials| credentials.user.clone())
    }

    fn bad_credentials(&self) -> Error {
        Error::BadCredentials { user: self.user() }
    }

    fn profile(&self) -> &str {
        self.profile.as_ref().map_or("", |profile| &profile.token)
    }

    async fn send(&mut self, command: &Command, abilities: &Abilities) -> Result<(), Error> {
        let motion = match command {
            Command::Move { motion, .. } if !motion.is_still() => *motion,
            _ => return self.stop(command, abilities).await,
        };
        self.moves.moving();
        match motion {
            Motion::Velocity { pan, tilt, zoom } => {
                let zoom = zoom.filter(|_| self.moves.zooms());
                let moved = self.turn((pan, tilt), zoom, abilities).await;
                if zoom.is_some() {
                    let broken = moved
                        .as_ref()
                        .is_err_and(|err| matches!(err, Error::Broken(_) | Error::Unexpected(_)));
                    if self.moves.zoomed(broken) {
                        self.leave_zoom(abilities).await;
                    }
                }
                moved
            }
            Motion::Absolute { .. } => {
                let Some((x, y, space, zoom)) = abilities.place(&motion) else {
                    return Err(Error::Camera("the camera takes no positions in degrees".to_owned()));
                };
                let message = messages::absolute_move(self.profile(), (x, y), Some(space), zoom);
                self.call(Path::Ptz, &message).await.map(drop)
            }
            Motion::Preset { number } => {
                if self.presets.is_empty() {
                    // Their numbers were told to somebody else, whose place this is.
                    self.presets().await?;
                }
                let index = usize::try_from(number).unwrap_or(usize::MAX).wrapping_sub(1);
                let Some(token) = self.presets.get(index) else {
                    return Err(Error::Camera(format!("there is no preset {number}")));
                };
                let message = messages::goto_preset(self.profile(), token);
                self.call(Path::Ptz, &message).await.map(drop)
            }
            Motion::Centre { .. } => Err(Error::Camera("ONVIF has no words for pixels".to_owned())),
        }
    }

    /// Where the camera does not take velocities in a unit that it told, it is moved in another from then on.
    async fn turn(
        &mut self,
        parts: (f64, f64),
        zoom: Option<f64>,
        abilities: &Abilities,
    ) -> Result<(), Error> {
        let velocity = abilities.velocity(parts, zoom);
        let moved = self.move_at(&velocity, abilities).await;
        let (refusal, space) = match (moved, &velocity.space) {
            (Err(refusal @ Error::Camera(_)), Some(space)) => (refusal, space),
            (moved, _) => return moved,
        };
        let mut others = abilities.clone();
        others.forget_space(space);
        // Where that is refused too, it was not for the unit.
        Box::pin(self.turn(parts, zoom, &others)).await.map_err(|err| worse(refusal, err))?;
        if let Some(abilities) = &mut self.abilities {
            abilities.forget_space(space);
        }
        Ok(())
    }

    /// Where the camera does not take a timeout, it is moved without.
    async fn move_at(&mut self, velocity: &Velocity, abilities: &Abilities) -> Result<(), Error> {
        let MoveTimeout::After(after) = abilities.timeout else {
            let message = messages::continuous_move(self.profile(), velocity, None);
            return self.call(Path::Ptz, &message).await.map(drop);
        };
        let message = messages::continuous_move(self.profile(), velocity, Some(after));
        let moved = self.call(Path::Ptz, &message).await;
        let (refusal, breaks) = match moved {
            Err(refusal @ Error::Camera(_)) => (refusal, false),
            Err(broken @ Error::Broken(_)) if self.moves.breaks_at_timeout() => (broken, true),
            other => {
                self.moves.took_timeout(other.is_ok());
                return other.map(drop);
            }
        };
        let message = messages::continuous_move(self.profile(), velocity, None);
        // Where it refuses even so, it was not for the timeout.
        self.call(Path::Ptz, &message).await.map_err(|err| worse(refusal, err))?;
        // One that was busy may take the next.
        if !breaks && !self.moves.refuses_timeout() {
            return Ok(());
        }
        if let Some(abilities) = &mut self.abilities {
            abilities.timeout = MoveTimeout::Never;
        }
        self.warn_of_no_timeout();
        Ok(())
    }

    /// A camera that breaks off where it is told to zoom may zoom all the same: it is stopped twice, which is in both ways.
    async fn leave_zoom(&mut self, abilities: &Abilities) {
        for _ in 0..2 {
            // What comes of these is seen in the moves that follow.
            let _ = self.stop(&Command::Stop(Stop::AllAxes), abilities).await;
        }
        self.moves.leave_zoom();
        self.warn("the camera breaks off its answer when told to zoom: it is not zoomed from now on");
    }

    async fn stop(&mut self, command: &Command, abilities: &Abilities) -> Result<(), Error> {
        let words = self.moves.next_stop();
        match self.stop_by(words, command, abilities).await {
            // Some close the connection at it.
            Err(Error::Camera(_) | Error::Broken(_)) => {
                self.moves.stop_refused();
                let other = self.moves.stop_words();
                self.stop_by(other, command, abilities).await
            }
            other => other,
        }
    }

    async fn stop_by(
        &mut self,
        words: StopWords,
        command: &Command,
        abilities: &Abilities,
    ) -> Result<(), Error> {
        match words {
            StopWords::Stop => {
                let message = messages::stop(self.profile());
                self.say(Path::Ptz, &message, Repeat::UntilHeard).await.map(drop)
            }
            StopWords::Still => {
                // A move to a position may have zoomed too.
                let zoom = *command != Command::Stop(Stop::PanTilt) && self.moves.zooms();
                self.move_at(&abilities.velocity((0.0, 0.0), zoom.then_some(0.0)), abilities).await
            }
        }
    }

    /// Where the camera looks. Some take half a minute to say so: they are asked only whether they are there.
    async fn position(&mut self, abilities: &Abilities) -> Result<Position, Error> {
        let is_asked = self.late_statuses < LATE_STATUSES;
        if is_asked {
            let message = messages::get_status(self.profile());
            match timeout(STATUS_TIMEOUT, self.call(Path::Ptz, &message)).await {
                Ok(Ok(body)) => {
                    self.late_statuses = 0;
                    let position = parse_position(&body, abilities);
                    return position
                        .ok_or_else(|| Error::Camera("the camera does not tell its position".to_owned()));
                }
                Ok(Err(err)) => return Err(err),
                Err(_) => {}
            }
        }
        self.clock = Some(self.ask_clock().await?);
        // It is there, and late with this alone.
        self.late_statuses += u32::from(is_asked);
        Err(Error::Camera("the camera takes too long to tell its position".to_owned()))
    }

    async fn presets(&mut self) -> Result<Presets, Error> {
        let body = self.call(Path::Ptz, &messages::get_presets(self.profile())).await?;
        let (tokens, presets) = parse_presets(&body).ok_or_else(|| unexpected(""))?;
        self.presets = tokens;
        Ok(presets)
    }

    fn warn_of_no_timeout(&mut self) {
        self.warn("the camera refuses moves with a time limit: if the network fails during a move, it keeps turning. Leave `dead-man` on, and use a reliable network");
    }

    fn warn(&mut self, text: &str) {
        self.warning = Some(text.to_owned());
    }
}

/// Which of two failures to tell: one on which the camera may have acted, or else who is refused, as whoever takes that for a fault of
/// the camera tries the password for ever; or else the first, in its own words.
fn worse(first: Error, second: Error) -> Error {
    let is_refused = matches!(
        second,
        Error::NotPermitted { .. } | Error::BadCredentials { .. } | Error::CredentialsMissing
    );
    if second.may_have_acted() || (is_refused && !first.may_have_acted()) { second } else { first }
}

/// The tokens are the camera's own words.
fn no_such_profile(wanted: &str, tokens: &[String]) -> Error {
    let tokens = excerpt(&tokens.join(", "));
    Error::Camera(format!("no profile `{wanted}` with PTZ; set `profile` to one of {tokens}"))
}

/// Where a message goes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Path {
    Device,
    Media,
    Media2,
    Ptz,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_is_refused_is_told_and_not_what_the_camera_had_against_the_first_form_of_a_move() {
        let first = || Error::Camera("no such unit".to_owned());
        let refused = [Error::NotPermitted { user: "root".to_owned() }, Error::CredentialsMissing];
        for second in refused {
            assert_eq!(worse(first(), second.clone()), second);
        }
        assert_eq!(worse(first(), Error::Camera("no such space".to_owned())), first());
        let late = || Error::Timeout(Duration::from_secs(1));
        assert_eq!(worse(late(), Error::CredentialsMissing), late(), "it may be turning");
    }

    #[test]
    fn the_profiles_that_there_are_are_no_order_to_a_terminal() {
        let tokens = ["a\u{1b}[2J".to_owned(), "b\r\nc".to_owned()];
        let told = "no profile `x` with PTZ; set `profile` to one of a[2J, b c";
        assert_eq!(no_such_profile("x", &tokens), Error::Camera(told.to_owned()));
    }
}
