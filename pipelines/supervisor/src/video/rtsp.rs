// SPDX-License-Identifier: MPL-2.0

//! RTSP, between an `rtspsrc` on this machine and the camera: `rtspsrc` knows no password, and what it asks for is signed here.

use std::collections::VecDeque;
use std::io;
use std::sync::mpsc::SyncSender;
use std::sync::{Arc, PoisonError};
use std::time::Duration;

use http::{HeaderMap, HeaderValue, header};
use rustls::pki_types::ServerName;
use session::Error;
use session::http::{Authenticator, ClientSettings, excerpt, without_user_info};
use tokio::io::{
    AsyncBufReadExt, AsyncRead, AsyncWrite, AsyncWriteExt, BufReader, ReadHalf, WriteHalf, split,
};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::Mutex;
use tokio::task::{AbortHandle, JoinSet};
use tokio::time::timeout;
use tokio_rustls::TlsConnector;

use super::address::rtsp_host;
use super::media::Media;
use super::rtsp_message::{Item, Message};
use super::{Ended, Failure, LONGEST_SILENCE, LONGEST_START, Video};

/// Challenges to one request that are answered, where each says that the one before is stale.
const MOST_CHALLENGES: usize = 5;

/// Streams that a camera may offer: `rtspsrc` sets up each of them.
const MOST_STREAMS: usize = 16;

/// Connections within this machine that are listened to at a time.
const MOST_VISITORS: usize = 64;

/// A connection, in clear or not.
trait Connection: AsyncRead + AsyncWrite + Send + Unpin {}
impl<T: AsyncRead + AsyncWrite + Send + Unpin> Connection for T {}

/// Connects to the camera, reports where `rtspsrc` finds it, and carries what both say until either ends.
pub async fn carry(
    settings: &ClientSettings,
    camera: &str,
    target: &str,
    report: &SyncSender<Result<Video, Failure>>,
    ended: &Ended,
) {
    let opened = async {
        let (connection, is_verified) = connect(settings, camera).await?;
        let listener = TcpListener::bind(("127.0.0.1", 0)).await.map_err(Failure::new)?;
        let address = listener.local_addr().map_err(Failure::new)?;
        let own = format!("rtsp://{address}/{}", word().map_err(Failure::new)?);
        Ok((connection, is_verified, listener, own))
    };
    let (connection, is_verified, listener, own) = match opened.await {
        Ok(opened) => opened,
        // Who waited for it may have given up.
        Err(failure) => return drop(report.try_send(Err(failure))),
    };
    if report.try_send(Ok(Video::Rtsp(format!("{own}{target}")))).is_err() {
        return;
    }
    let Ok(Ok(source)) = timeout(LONGEST_START, accept(&listener, &own)).await else { return };
    drop(listener);
    let (from_camera, to_camera) = split(connection);
    let (from_source, mut to_source) = split(source);
    let asking = Asking {
        camera: camera.trim_end_matches('/').to_owned(),
        own,
        is_verified,
        login: Authenticator::new(settings.credentials.clone(), settings.authentication),
        last: None,
        challenges: 0,
        to_camera,
    };
    let asking = Arc::new(Mutex::new(asking));
    let result = tokio::select! {
        result = ask(BufReader::new(from_source), &asking) => result,
        result = answer(BufReader::new(from_camera), &mut to_source, &asking) => result,
    };
    if let Err(failure) = result {
        *ended.lock().unwrap_or_else(PoisonError::into_inner) = Some(failure);
    }
}

/// 128 random bits: others on this machine must not find the camera behind the open door.
fn word() -> io::Result<String> {
    let mut bytes = [0; 16];
    io::Read::read_exact(&mut std::fs::File::open("/dev/urandom")?, &mut bytes)?;
    Ok(bytes.iter().map(|byte| format!("{byte:02x}")).collect())
}

/// A connection to the camera, and whether the camera is known to be at the other end.
async fn connect(settings: &ClientSettings, camera: &str) -> Result<(Box<dyn Connection>, bool), Failure> {
    let (host, port, over_tls) = rtsp_host(camera)
        .ok_or_else(|| Failure::new(format!("{} names no host", without_user_info(camera))))?;
    let bare = host.trim_matches(['[', ']']);
    let said = |err: io::Error| Failure::new(format!("{host}, port {port}: {err}"));
    let late = |_| said(io::ErrorKind::TimedOut.into());
    let tcp =
        timeout(LONGEST_SILENCE, TcpStream::connect((bare, port))).await.map_err(late)?.map_err(said)?;
    tcp.set_nodelay(true).map_err(said)?;
    if !over_tls {
        return Ok((Box::new(tcp), false));
    }
    let connector = TlsConnector::from(Arc::new(settings.trust.client_config(true)?));
    let name = ServerName::try_from(bare.to_owned()).map_err(Failure::new)?;
    let tls = timeout(LONGEST_START, connector.connect(name, tcp)).await.map_err(late)?.map_err(said)?;
    Ok((Box::new(tls), settings.trust.is_verified(true)))
}

/// The first connection that knows the word; whoever else of this machine connects is sent away.
async fn accept(listener: &TcpListener, own: &str) -> io::Result<TcpStream> {
    let mut visitors = Visitors::default();
    loop {
        tokio::select! {
            visitor = listener.accept() => visitors.add(visitor?.0, own.to_owned()),
            heard = visitors.heard.join_next(), if !visitors.heard.is_empty() => {
                // Who was sent away to make room is an error here.
                if let Ok(Some(stream)) = heard.unwrap_or(Ok(None)) {
                    return Ok(stream);
                }
            }
        }
    }
}

/// Who is listened to, all at once: who connects and says nothing must not keep `rtspsrc` waiting behind.
#[derive(Default)]
struct Visitors {
    heard: JoinSet<Option<TcpStream>>,
    oldest_first: VecDeque<AbortHandle>,
}

impl Visitors {
    /// Makes room by the one who has said nothing for longest: `rtspsrc` speaks at once.
    fn add(&mut self, stream: TcpStream, own: String) {
        self.oldest_first.retain(|visitor| !visitor.is_finished());
        if self.oldest_first.len() >= MOST_VISITORS
            && let Some(oldest) = self.oldest_first.pop_front()
        {
            oldest.abort();
        }
        self.oldest_first.push_back(self.heard.spawn(hear(stream, own)));
    }
}

/// Gives back who knows the word, and says so in time.
async fn hear(stream: TcpStream, own: String) -> Option<TcpStream> {
    let knows = timeout(LONGEST_SILENCE, asks_for(&stream, &own)).await;
    matches!(knows, Ok(Ok(true))).then_some(stream)
}

/// Whether a connection begins with a request for this; nothing is read from it.
async fn asks_for(stream: &TcpStream, own: &str) -> io::Result<bool> {
    let mut first = [0; 256];
    // Before the first line is whole, nothing is to be said of it.
    loop {
        let bytes = stream.peek(&mut first).await?;
        let text = String::from_utf8_lossy(&first[..bytes]).into_owned();
        if bytes == 0 || bytes == first.len() || text.contains('\n') {
            return Ok(text.split(' ').nth(1).is_some_and(|address| address.starts_with(own)));
        }
        tokio::time::sleep(Duration::from_millis(5)).await;
    }
}

/// Whoever asks the camera.
struct Asking {
    /// Address of the camera, as it is to be asked.
    camera: String,
    /// What `rtspsrc` takes for that.
    own: String,
    /// Whether the camera is known to be at the other end.
    is_verified: bool,
    login: Authenticator,
    /// The request that waits for its answer, unsigned.
    last: Option<Message>,
    /// How often it was challenged.
    challenges: usize,
    to_camera: WriteHalf<Box<dyn Connection>>,
}

impl Asking {
    async fn send(&mut self, request: &Message) -> Result<(), Failure> {
        let mut request = request.clone();
        let (method, address) = request.request().unwrap_or_default();
        if let Some(value) = self.login.authorization(method, address)? {
            let value = value.to_str().map_err(Failure::new)?.to_owned();
            request.headers.push(("Authorization".to_owned(), value));
        }
        self.write(&request.to_bytes()).await
    }

    /// Whoever does not read is not there.
    async fn write(&mut self, bytes: &[u8]) -> Result<(), Failure> {
        let written = timeout(LONGEST_SILENCE, self.to_camera.write_all(bytes)).await;
        written.map_err(|_| Failure::new("the camera takes nothing any more"))?.map_err(Failure::new)
    }

    /// Answers a challenge to the request that waits; whether it could.
    async fn challenged(&mut self, response: &Message) -> Result<(), Failure> {
        let Some(last) = self.last.clone() else { return Err(Failure::new("a challenge to nothing")) };
        let offers =
            response.headers_of("www-authenticate").filter_map(|offer| HeaderValue::from_str(offer).ok());
        let offers: HeaderMap = offers.map(|offer| (header::WWW_AUTHENTICATE, offer)).collect();
        let stale = self.login.challenged(&offers, self.is_verified)?;
        self.challenges += 1;
        let most = if stale { MOST_CHALLENGES } else { 1 };
        if self.challenges > most {
            return Err(Error::BadCredentials { user: self.login.user().to_owned() }.into());
        }
        self.send(&last).await
    }
}

/// From `rtspsrc` to the camera.
async fn ask(mut source: BufReader<ReadHalf<TcpStream>>, asking: &Mutex<Asking>) -> Result<(), Failure> {
    while let Some(item) = Item::read(&mut source).await.map_err(Failure::new)? {
        let mut asking = asking.lock().await;
        match item {
            Item::Message(mut message) if message.request().is_some() => {
                message.start = message.start.replacen(&asking.own, &asking.camera, 1);
                asking.send(&message).await?;
                (asking.last, asking.challenges) = (Some(message), 0);
            }
            other => asking.write(&other.to_bytes()).await?,
        }
    }
    Ok(())
}

/// From the camera to `rtspsrc`.
async fn answer(
    mut camera: BufReader<ReadHalf<Box<dyn Connection>>>,
    source: &mut (impl AsyncWrite + Unpin),
    asking: &Mutex<Asking>,
) -> Result<(), Failure> {
    let mut media = Media::default();
    while !camera.fill_buf().await.map_err(Failure::new)?.is_empty() {
        let Some(item) = Item::read(&mut camera).await.map_err(Failure::new)? else { break };
        match item {
            Item::Packet(packet) => {
                if let Some(passed) = media.pass(&packet)? {
                    source.write_all(&passed).await.map_err(Failure::new)?;
                }
            }
            Item::Message(message) if message.status() == Some(401) => {
                asking.lock().await.challenged(&message).await?;
            }
            Item::Message(message) => {
                check(&message)?;
                source.write_all(&message.to_bytes()).await.map_err(Failure::new)?;
            }
        }
    }
    Ok(())
}

/// Refuses a message by which `rtspsrc` would go elsewhere, set up streams without end, or open a way of its own.
fn check(message: &Message) -> Result<(), Failure> {
    if message.status().is_some_and(|status| (300..400).contains(&status)) {
        let to = message.header("location").unwrap_or_default();
        return Err(Error::Redirected(excerpt(to)).into());
    }
    let offered = streams(&message.body);
    if offered > MOST_STREAMS {
        return Err(Failure::new(format!("the camera offers {offered} streams, more than {MOST_STREAMS}")));
    }
    if !message.headers_of("transport").all(is_by_tcp) {
        return Err(Failure::new("the camera would send pictures by UDP, past this connection"));
    }
    Ok(())
}

/// Whether packets come in the connection itself (RFC 2326, section 12.39), by the letters that `rtspsrc` goes by: where it does not
/// find `TCP` at its place, or finds `multicast` anywhere, it opens ports of UDP, whatever it has asked for.
fn is_by_tcp(transport: &str) -> bool {
    let transport = transport.to_ascii_lowercase();
    let way = transport.split(';').next().unwrap_or_default();
    way.split('/').nth(2) == Some("tcp") && !transport.contains("multicast")
}

/// How many streams a description offers (SDP, RFC 8866): as many as it has media.
fn streams(description: &[u8]) -> usize {
    description
        .split(|byte| matches!(byte, b'\r' | b'\n'))
        .filter(|line| line.trim_ascii_start().starts_with(b"m="))
        .count()
}

#[cfg(test)]
mod tests {
    use session::http::{Authentication, Credentials, Secret};
    use tokio::io::{AsyncReadExt, DuplexStream, duplex};

    use super::*;

    fn message(start: &str, headers: &[(&str, &str)]) -> Message {
        let headers = headers.iter().map(|(name, value)| ((*name).to_owned(), (*value).to_owned()));
        Message { start: start.to_owned(), headers: headers.collect(), body: Vec::new() }
    }

    /// Who has asked the camera at the other end for something.
    fn asking(connection: DuplexStream) -> Asking {
        let credentials = Credentials { user: "root".to_owned(), password: Secret::new("pass") };
        let connection: Box<dyn Connection> = Box::new(connection);
        Asking {
            camera: "rtsp://camera".to_owned(),
            own: "rtsp://own".to_owned(),
            is_verified: false,
            login: Authenticator::new(Some(credentials), Authentication::Auto),
            last: Some(message("OPTIONS rtsp://camera/ RTSP/1.0", &[])),
            challenges: 0,
            to_camera: split(connection).1,
        }
    }

    #[tokio::test]
    async fn who_challenges_again_and_again_is_given_up() {
        let (near, _far) = duplex(64 * 1024);
        let mut asking = asking(near);
        let stale = [("WWW-Authenticate", "Digest realm=\"a\", nonce=\"b\", stale=true")];
        let challenge = message("RTSP/1.0 401 Unauthorized", &stale);
        for _ in 0..MOST_CHALLENGES {
            asking.challenged(&challenge).await.unwrap();
        }
        assert!(asking.challenged(&challenge).await.is_err());
    }

    #[tokio::test]
    async fn who_does_not_read_keeps_nobody_waiting() {
        let (near, _far) = duplex(16);
        assert!(asking(near).write(&[0; 64]).await.is_err());
    }

    /// What is passed on of what a camera says, and how that ended.
    async fn answered(said: &[u8]) -> (Vec<u8>, Result<(), Failure>) {
        let (near, mut far) = duplex(64 * 1024);
        far.write_all(said).await.unwrap();
        drop(far);
        let camera: Box<dyn Connection> = Box::new(near);
        let asking = Mutex::new(asking(duplex(16).0));
        let mut passed: Vec<u8> = Vec::new();
        let result = answer(BufReader::new(split(camera).0), &mut passed, &asking).await;
        (passed, result)
    }

    #[tokio::test]
    async fn who_would_send_past_the_connection_is_given_up() {
        let response =
            |transport: &str| format!("RTSP/1.0 200 OK\r\nCSeq: 3\r\nTransport: {transport}\r\n\r\n");
        for transport in ["RTP/AVP/TCP;unicast;interleaved=0-1", "rtp/avp/tcp;interleaved=2-3;ssrc=7"] {
            let said = response(transport);
            let (passed, result) = answered(said.as_bytes()).await;
            assert!(result.is_ok() && passed == said.as_bytes(), "{transport}: {result:?}");
        }
        for transport in [
            "RTP/AVP;unicast;client_port=5000-5001",
            "RTP/AVP/UDP;unicast;client_port=5000-5001",
            "RTP/AVP;multicast;destination=239.0.0.1;port=5000-5001",
            "RTP/AVP/TCP;Multicast",
            "RTP/AVP;unicast;source=TCP",
            // To `rtspsrc` it is another word.
            "RTP/AVP/TCP ;unicast;client_port=5000-5001",
            "",
        ] {
            let (passed, result) = answered(response(transport).as_bytes()).await;
            assert!(result.is_err() && passed.is_empty(), "{transport}: {result:?}");
        }
    }

    /// `rtspsrc` would keep something of everybody who is named in a description.
    #[tokio::test]
    async fn of_packets_pictures_pass_and_descriptions_of_strangers_do_not() {
        let picture = b"$\0\0\x0c\x80\x60\0\x01\0\0\0\0\0\0\0\x07";
        let description = b"$\x01\0\x0c\x81\xca\0\x02\0\0\0\x09\x01\0\0\0";
        let (passed, result) = answered(&[&picture[..], description, picture].concat()).await;
        assert!(result.is_ok(), "{result:?}");
        assert_eq!(passed, [*picture, *picture].concat());
    }

    #[test]
    fn streams_are_counted_as_rtspsrc_does() {
        let description = b"v=0\r\nm=video 0 RTP/AVP 96\r\na=control:m=1\r\n \tm=audio 0 RTP/AVP 97\r\n";
        assert_eq!((streams(description), streams(b"")), (2, 0));
    }

    /// A connection within this machine that begins like this.
    async fn visitor(address: std::net::SocketAddr, first: &str) -> TcpStream {
        let mut stream = TcpStream::connect(address).await.unwrap();
        stream
            .write_all(format!("OPTIONS {first}/axis-media/media.amp RTSP/1.0\r\nCSeq: 1\r\n\r\n").as_bytes())
            .await
            .unwrap();
        stream
    }

    #[tokio::test]
    async fn the_door_is_for_who_knows_the_word() {
        let listener = TcpListener::bind(("127.0.0.1", 0)).await.unwrap();
        let address = listener.local_addr().unwrap();
        let own = format!("rtsp://{address}/{}", word().unwrap());
        assert_ne!(word().unwrap(), word().unwrap());
        let accepted = tokio::spawn({
            let own = own.clone();
            async move { accept(&listener, &own).await }
        });
        let mut stranger = visitor(address, &format!("rtsp://{address}")).await;
        // Closed, or reset, as what it said was not read.
        assert_eq!(stranger.read(&mut [0]).await.unwrap_or(0), 0);
        let friend = visitor(address, &own).await;
        assert_eq!(accepted.await.unwrap().unwrap().peer_addr().unwrap(), friend.local_addr().unwrap());
    }

    /// One after the other, the silent ones would take twice as long as there is.
    #[tokio::test]
    async fn who_says_nothing_at_the_door_keeps_nobody_waiting() {
        let listener = TcpListener::bind(("127.0.0.1", 0)).await.unwrap();
        let address = listener.local_addr().unwrap();
        let own = format!("rtsp://{address}/{}", word().unwrap());
        let mut silent = Vec::new();
        for _ in 0..8 {
            silent.push(TcpStream::connect(address).await.unwrap());
        }
        let friend = visitor(address, &own).await;
        let accepted = timeout(LONGEST_START, accept(&listener, &own)).await.unwrap().unwrap();
        assert_eq!(accepted.peer_addr().unwrap(), friend.local_addr().unwrap());
    }

    #[tokio::test]
    async fn a_crowd_at_the_door_is_no_larger_than_is_listened_to() {
        let listener = TcpListener::bind(("127.0.0.1", 0)).await.unwrap();
        let address = listener.local_addr().unwrap();
        let own = format!("rtsp://{address}/{}", word().unwrap());
        let (mut visitors, mut silent) = (Visitors::default(), Vec::new());
        for _ in 0..=MOST_VISITORS {
            silent.push(TcpStream::connect(address).await.unwrap());
            visitors.add(listener.accept().await.unwrap().0, own.clone());
        }
        assert!(visitors.oldest_first.len() <= MOST_VISITORS);
        assert_eq!(silent[0].read(&mut [0]).await.unwrap(), 0);
    }
}
