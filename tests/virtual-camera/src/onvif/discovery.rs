// SPDX-License-Identifier: MPL-2.0

//! WS-Discovery: answers who asks on the loopback interface whether a camera is there.

use std::{
    io,
    net::{Ipv4Addr, SocketAddr, UdpSocket},
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    thread::JoinHandle,
    time::Duration,
};

use roxmltree::Document;
use socket2::{Domain, Protocol, Socket, Type};

use super::{DEVICE_SERVICE, message::Message};

/// ONVIF Core, section 7.
const GROUP: Ipv4Addr = Ipv4Addr::new(239, 255, 255, 250);
const PORT: u16 = 3702;

/// How often it is seen whether the camera is to end.
const LOOK: Duration = Duration::from_millis(200);

/// A camera that lets itself be found; dropping it ends that.
pub(crate) struct Discovery {
    ending: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Discovery {
    /// Answers for the camera whose HTTP is at `address`.
    pub fn start(address: SocketAddr) -> io::Result<Self> {
        let socket = Socket::new(Domain::IPV4, Type::DGRAM, Some(Protocol::UDP))?;
        // Many cameras on one machine hear each question.
        socket.set_reuse_address(true)?;
        socket.bind(&SocketAddr::from((Ipv4Addr::UNSPECIFIED, PORT)).into())?;
        socket.join_multicast_v4(&GROUP, &Ipv4Addr::LOCALHOST)?;
        socket.set_read_timeout(Some(LOOK))?;
        let socket = UdpSocket::from(socket);
        let ending = Arc::new(AtomicBool::new(false));
        let ends = ending.clone();
        let thread = std::thread::Builder::new().name("camera-discovery".into()).spawn(move || {
            let mut question = [0; 8192];
            while !ends.load(Ordering::Relaxed) {
                let Ok((length, asker)) = socket.recv_from(&mut question) else { continue };
                let asked = question.get(..length).and_then(|bytes| std::str::from_utf8(bytes).ok());
                if let Some(answer) = asked.and_then(|text| answer(text, address)) {
                    // Who is gone meanwhile needs none.
                    let _ = socket.send_to(answer.as_bytes(), asker);
                }
            }
        })?;
        Ok(Self { ending, thread: Some(thread) })
    }
}

impl Drop for Discovery {
    fn drop(&mut self) {
        self.ending.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            // It ended with a panic at worst, which has been printed.
            let _ = thread.join();
        }
    }
}

/// `None` where that is no question for cameras.
fn answer(text: &str, address: SocketAddr) -> Option<String> {
    let document = Document::parse(text).ok()?;
    let question = Message::of(&document)?;
    let id = document.descendants().find(|node| node.tag_name().name() == "MessageID")?.text()?;
    let types = question.body.children().find(|node| node.tag_name().name() == "Types");
    let asked = types.and_then(|types| types.text()).unwrap_or("NetworkVideoTransmitter");
    let is_probe = question.body.tag_name().name() == "Probe" && asked.contains("NetworkVideoTransmitter");
    is_probe.then(|| {
        format!(
            r#"<env:Envelope xmlns:env="http://www.w3.org/2003/05/soap-envelope" xmlns:a="http://schemas.xmlsoap.org/ws/2004/08/addressing" xmlns:d="http://schemas.xmlsoap.org/ws/2005/04/discovery" xmlns:dn="http://www.onvif.org/ver10/network/wsdl"><env:Header><a:MessageID>uuid:76697274-7561-6c00-0000-00000000{port:04x}</a:MessageID><a:RelatesTo>{id}</a:RelatesTo><a:To>http://schemas.xmlsoap.org/ws/2004/08/addressing/role/anonymous</a:To><a:Action>http://schemas.xmlsoap.org/ws/2005/04/discovery/ProbeMatches</a:Action></env:Header><env:Body><d:ProbeMatches><d:ProbeMatch><a:EndpointReference><a:Address>urn:uuid:76697274-7561-6c00-0001-00000000{port:04x}</a:Address></a:EndpointReference><d:Types>dn:NetworkVideoTransmitter</d:Types><d:Scopes>onvif://www.onvif.org/type/ptz onvif://www.onvif.org/name/virtual%20camera onvif://www.onvif.org/hardware/virtual%20camera</d:Scopes><d:XAddrs>http://{address}{DEVICE_SERVICE}</d:XAddrs><d:MetadataVersion>1</d:MetadataVersion></d:ProbeMatch></d:ProbeMatches></env:Body></env:Envelope>"#,
            port = address.port(),
        )
    })
}
