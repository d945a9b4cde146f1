// SPDX-License-Identifier: MPL-2.0

//! Connections that can be made to fail, and the door they come through.

use std::{
    future::pending,
    io,
    net::SocketAddr,
    pin::Pin,
    sync::{Arc, Mutex},
    task::{Context, Poll, ready},
    time::Duration,
};

use axum::{
    extract::connect_info::Connected,
    serve::{IncomingStream, Listener},
};
use tokio::{
    io::{AsyncRead, AsyncWrite, ReadBuf},
    net::{TcpListener, TcpStream},
    sync::watch,
};

use super::reserve;
use crate::{Fault, sync::lock};

const BACKLOG: u32 = 64;

/// Between two attempts to have a lost port again.
const LOST: Duration = Duration::from_millis(50);

/// How a connection is to end.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Ending {
    /// By a reset, instead of the next answer.
    Reset,
    /// With these bytes instead of the next answer.
    Garbage(Vec<u8>),
    /// After the next answer.
    Closed,
}

/// A handler's hold on the connection that its request came through.
#[derive(Debug, Clone, Default)]
pub(super) struct Connection(Arc<Mutex<Option<Ending>>>);

impl Connection {
    /// Takes effect as the answer is written.
    pub fn end(&self, ending: Ending) {
        *lock(&self.0) = Some(ending);
    }
}

impl Connected<IncomingStream<'_, Door>> for Connection {
    fn connect_info(stream: IncomingStream<'_, Door>) -> Self {
        stream.io().connection.clone()
    }
}

/// A TCP stream under such a hold.
pub(super) struct Wire {
    stream: TcpStream,
    connection: Connection,
    answered: bool,
}

impl AsyncRead for Wire {
    fn poll_read(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
        buf: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        let ended = self.answered && lock(&self.connection.0).is_some();
        // What a client still sends after that is not read any more.
        if ended { Poll::Ready(Ok(())) } else { Pin::new(&mut self.stream).poll_read(cx, buf) }
    }
}

impl AsyncWrite for Wire {
    fn poll_write(mut self: Pin<&mut Self>, cx: &mut Context<'_>, buf: &[u8]) -> Poll<io::Result<usize>> {
        let ending = lock(&self.connection.0).clone();
        match ending {
            None => Pin::new(&mut self.stream).poll_write(cx, buf),
            Some(Ending::Reset) => {
                self.stream.set_zero_linger()?;
                Poll::Ready(Err(io::ErrorKind::ConnectionReset.into()))
            }
            Some(Ending::Garbage(bytes)) => {
                // A handful of bytes always fits into an idle socket's buffer.
                ready!(Pin::new(&mut self.stream).poll_write(cx, &bytes))?;
                Poll::Ready(Err(io::ErrorKind::BrokenPipe.into()))
            }
            Some(Ending::Closed) => {
                self.answered = true;
                Pin::new(&mut self.stream).poll_write(cx, buf)
            }
        }
    }

    fn poll_flush(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        if self.answered {
            return Pin::new(&mut self.stream).poll_shutdown(cx);
        }
        Pin::new(&mut self.stream).poll_flush(cx)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_shutdown(cx)
    }
}

/// The listening socket, which closes while connections are to be refused.
pub(super) struct Door {
    address: SocketAddr,
    listener: Option<TcpListener>,
    fault: watch::Receiver<Fault>,
}

impl Door {
    /// Listens on `address`; with port 0 on a free one.
    pub fn open(address: SocketAddr, fault: watch::Receiver<Fault>) -> io::Result<Self> {
        let listener = reserve(address)?.listen(BACKLOG)?;
        Ok(Self { address: listener.local_addr()?, listener: Some(listener), fault })
    }

    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Lets no connection come about until the fault is over, and keeps the port from others meanwhile.
    async fn shut(&mut self) {
        self.listener = None;
        let silent = *self.fault.borrow() == Fault::BlackHole;
        if silent {
            let address = self.address;
            tokio::select! {
                () = full_queue(address) => {}
                () = self.fault_over() => {}
            }
        } else {
            // A socket that does not listen refuses.
            let reserved = reserve(self.address);
            self.fault_over().await;
            self.listener = reserved.and_then(|socket| socket.listen(BACKLOG)).ok();
        }
    }

    async fn fault_over(&mut self) {
        if self.fault.wait_for(|fault| !fault.shuts()).await.is_err() {
            pending::<()>().await;
        }
    }

    async fn next(&mut self) -> Option<(TcpStream, SocketAddr)> {
        let listener = self.listener.as_ref()?;
        let mut fault = self.fault.clone();
        tokio::select! {
            accepted = listener.accept() => accepted.ok(),
            _ = fault.wait_for(Fault::shuts) => None,
        }
    }
}

/// Holds a socket whose queue is full, for as long as it is awaited: the kernel drops whatever comes.
async fn full_queue(address: SocketAddr) {
    let _listener = reserve(address).and_then(|socket| socket.listen(0));
    // Where a client was quicker, the queue is full of it, and this goes unanswered for minutes.
    let _filling = TcpStream::connect(address).await;
    pending().await
}

impl Listener for Door {
    type Io = Wire;
    type Addr = SocketAddr;

    async fn accept(&mut self) -> (Wire, SocketAddr) {
        loop {
            if self.fault.borrow().shuts() {
                self.shut().await;
            }
            if let Some((stream, address)) = self.next().await {
                // Commands are small and must not wait for one another.
                let _ = stream.set_nodelay(true);
                return (Wire { stream, connection: Connection::default(), answered: false }, address);
            }
            if self.listener.is_none() {
                self.listener = reserve(self.address).and_then(|socket| socket.listen(BACKLOG)).ok();
            }
            if self.listener.is_none() {
                // The port was lost to somebody else meanwhile, who may let go of it again.
                tokio::time::sleep(LOST).await;
            }
        }
    }

    fn local_addr(&self) -> io::Result<SocketAddr> {
        Ok(self.address)
    }
}
