// SPDX-License-Identifier: MPL-2.0

//! What stands in front of a virtual camera: TLS, which it does not speak, and other addresses.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream, ToSocketAddrs};

use rustls::{ServerConnection, StreamOwned};

#[path = "../certificates/mod.rs"]
pub mod certificates;

use certificates::server_config;

/// Where the camera at `camera` can be spoken to over TLS; it shows the certificate `name`.
pub fn tls_front(camera: SocketAddr, name: &str) -> String {
    let (config, listener) = (server_config(name), TcpListener::bind(("127.0.0.1", 0)).unwrap());
    let address = listener.local_addr().unwrap();
    std::thread::spawn(move || {
        for stream in listener.incoming().map_while(Result::ok) {
            let connection = ServerConnection::new(config.clone()).unwrap();
            // A client that goes away ends its thread.
            std::thread::spawn(move || pass_on(StreamOwned::new(connection, stream), camera));
        }
    });
    format!("https://{address}")
}

/// From here on the camera can be spoken to at `address`, too.
pub fn pass_on_from(address: impl ToSocketAddrs, camera: SocketAddr) {
    let listener = TcpListener::bind(address).unwrap();
    std::thread::spawn(move || {
        for client in listener.incoming().map_while(Result::ok) {
            std::thread::spawn(move || pass_on(client, camera));
        }
    });
}

/// One request after the other, each over a connection of its own to the camera.
fn pass_on(client: impl Read + Write, camera: SocketAddr) -> std::io::Result<()> {
    let mut client = BufReader::new(client);
    loop {
        let mut head = String::new();
        while !head.ends_with("\r\n\r\n") {
            if client.read_line(&mut head)? == 0 {
                return Ok(());
            }
        }
        let mut behind = TcpStream::connect(camera)?;
        behind.write_all(head.trim_end().as_bytes())?;
        behind.write_all(b"\r\nconnection: close\r\n\r\n")?;
        let mut answer = Vec::new();
        behind.read_to_end(&mut answer)?;
        // The connection in front stays.
        let text = String::from_utf8_lossy(&answer).replacen("connection: close\r\n", "", 1);
        client.get_mut().write_all(text.as_bytes())?;
        client.get_mut().flush()?;
    }
}
