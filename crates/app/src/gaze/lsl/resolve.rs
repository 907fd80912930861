//! Finding streams: a question by UDP to which every stream answers with its description.

use std::io::{ErrorKind, Read, Write};
use std::net::{IpAddr, Ipv4Addr, SocketAddr, ToSocketAddrs, UdpSocket};
use std::time::{Duration, Instant};

use crate::gaze::feed::Ended;
use crate::gaze::parse::lsl_info::{self, MAX_XML, StreamInfo};

/// Port of questions to everybody.
const MULTICAST_PORT: u16 = 16_571;
/// Ports that streams of one machine take, one each.
const UNICAST_PORTS: std::ops::RangeInclusive<u16> = 16_572..=16_603;
/// Where questions to everybody go; all of them are confined to the local network.
const GROUPS: [Ipv4Addr; 4] = [
    Ipv4Addr::BROADCAST,
    Ipv4Addr::new(224, 0, 0, 1),
    Ipv4Addr::new(224, 0, 0, 183),
    Ipv4Addr::new(239, 255, 172, 215),
];
/// How often the question is asked again.
const REPEAT: Duration = Duration::from_millis(500);
/// How long a description may take to come as a whole.
const DESCRIPTION: Duration = Duration::from_secs(3);
/// Streams that are listed.
const MAX_STREAMS: usize = 64;

/// A stream and where it is.
#[derive(Clone, Debug, PartialEq)]
pub struct Found {
    /// Its description, without channels.
    pub info: StreamInfo,
    /// The host that answered.
    pub address: IpAddr,
}

/// Asks for streams until `enough` says so of what has been found, or the time is up.
///
/// With a host only that host is asked; without, this machine and the local network are.
///
/// # Errors
/// When no socket can be had, or the host is unknown.
pub fn resolve(host: Option<&str>, patience: Duration, enough: impl Fn(&[Found]) -> bool) -> Result<Vec<Found>, Ended> {
    let socket = UdpSocket::bind((Ipv4Addr::UNSPECIFIED, 0))?;
    socket.set_broadcast(true)?;
    let port = socket.local_addr()?.port();
    let targets = targets(host)?;
    // The number ties answers to this question: others may arrive late from an earlier one.
    let id = format!("{}", u32::from(port) << 16 | (std::process::id() & 0xffff));
    let question = format!("LSL:shortinfo\r\nsession_id='default'\r\n{port} {id}\r\n");
    let start = Instant::now();
    let mut asked: Option<Instant> = None;
    let mut found: Vec<Found> = Vec::new();
    let mut datagram = vec![0; 65_536];
    while start.elapsed() < patience && !enough(&found) && found.len() < MAX_STREAMS {
        if asked.is_none_or(|at| at.elapsed() >= REPEAT) {
            asked = Some(Instant::now());
            for target in &targets {
                // A network without multicast or broadcast refuses some of these; the others may still be heard.
                let _ = socket.send_to(question.as_bytes(), target);
            }
        }
        socket.set_read_timeout(Some(Duration::from_millis(50)))?;
        match socket.recv_from(&mut datagram) {
            Ok((count, from)) => {
                let Ok((answered, info)) = lsl_info::discovery_reply(&datagram[..count]) else { continue };
                if answered == id && found.iter().all(|known| known.info.uid != info.uid) {
                    found.push(Found { info, address: from.ip() });
                }
            }
            // Windows and Linux report datagrams that nobody took as errors of a later read.
            Err(error)
                if matches!(
                    error.kind(),
                    ErrorKind::WouldBlock
                        | ErrorKind::TimedOut
                        | ErrorKind::ConnectionReset
                        | ErrorKind::ConnectionRefused
                ) => {}
            Err(error) => return Err(error.into()),
        }
    }
    Ok(found)
}

fn targets(host: Option<&str>) -> Result<Vec<SocketAddr>, Ended> {
    let unicast = |address: IpAddr| UNICAST_PORTS.map(move |port| SocketAddr::new(address, port));
    let Some(host) = host else {
        let groups = GROUPS.map(|group| SocketAddr::new(group.into(), MULTICAST_PORT));
        return Ok(groups.into_iter().chain(unicast(Ipv4Addr::LOCALHOST.into())).collect());
    };
    let addresses =
        (host, MULTICAST_PORT).to_socket_addrs().map_err(|error| Ended::Lost(format!("{host}: {error}")))?;
    Ok(addresses.filter(SocketAddr::is_ipv4).flat_map(|address| unicast(address.ip())).collect())
}

/// The whole description of a stream, with its channels.
///
/// # Errors
/// When the stream is gone or describes itself wrongly.
pub fn full_info(found: &Found) -> Result<StreamInfo, Ended> {
    let address = SocketAddr::new(found.address, found.info.data_port);
    let mut stream = std::net::TcpStream::connect_timeout(&address, Duration::from_secs(2))?;
    stream.set_read_timeout(Some(Duration::from_secs(2)))?;
    stream.write_all(b"LSL:fullinfo\r\n")?;
    let (mut xml, mut part, asked) = (Vec::new(), [0; 16_384], Instant::now());
    // One byte beyond the limit tells a description that is too long from one that just fits.
    while xml.len() <= MAX_XML {
        if asked.elapsed() > DESCRIPTION {
            return Err(Ended::Lost("the stream's description does not end".into()));
        }
        match stream.read(&mut part)? {
            0 => break,
            count => xml.extend_from_slice(&part[..count]),
        }
    }
    let xml = String::from_utf8(xml).map_err(|_| Ended::Failed("the stream's description is not text".into()))?;
    StreamInfo::from_xml(&xml).map_err(|error| Ended::Failed(error.to_string()))
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;

    #[test]
    fn a_description_that_does_not_end_is_given_up() {
        let listener = std::net::TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
        let data_port = listener.local_addr().unwrap().port();
        std::thread::spawn(move || {
            let (mut stream, _) = listener.accept().unwrap();
            // Until the other side hangs up.
            while stream.write_all(b" ").is_ok() {
                std::thread::sleep(Duration::from_millis(50));
            }
        });
        let xml = format!(
            "<info><channel_count>2</channel_count><channel_format>float32</channel_format><nominal_srate>60\
            </nominal_srate><uid>u</uid><v4data_port>{data_port}</v4data_port><v4service_port>1</v4service_port></info>"
        );
        let found = Found { info: StreamInfo::from_xml(&xml).unwrap(), address: Ipv4Addr::LOCALHOST.into() };
        let asked = Instant::now();
        assert!(matches!(full_info(&found), Err(Ended::Lost(why)) if why.contains("does not end")));
        assert!(asked.elapsed() < 3 * DESCRIPTION);
    }

    #[test]
    fn only_the_host_that_was_named_is_asked() {
        let one = targets(Some("127.0.0.1")).unwrap();
        assert!(!one.is_empty() && one.iter().all(|target| target.ip() == IpAddr::from([127, 0, 0, 1])));
        let all = targets(None).unwrap();
        assert!(all.contains(&"255.255.255.255:16571".parse().unwrap()));
        assert!(all.contains(&"127.0.0.1:16603".parse().unwrap()));
    }
}
