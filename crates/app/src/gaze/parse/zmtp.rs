//! ZeroMQ's wire protocol, ZMTP 3.0 with the NULL mechanism: greeting, frames and messages of a client.
//!
//! Reference: ZeroMQ RFC 23/ZMTP. Only what a SUB or REQ socket needs, with bounded frames.

use super::ParseError;

/// Bytes of the largest frame that is read.
pub const MAX_FRAME: usize = 1 << 20;
/// Frames of the longest message that is read.
pub const MAX_FRAMES: usize = 16;
/// Bytes of a greeting.
pub const GREETING: usize = 64;

/// Our greeting: version 3.0, mechanism NULL.
pub fn greeting() -> [u8; GREETING] {
    let mut bytes = [0; GREETING];
    bytes[0] = 0xff;
    bytes[9] = 0x7f;
    bytes[10] = 3;
    bytes[12..16].copy_from_slice(b"NULL");
    bytes
}

/// The READY command of a socket type, `SUB` or `REQ`.
pub fn ready(socket_type: &str) -> Vec<u8> {
    let mut body = b"\x05READY\x0bSocket-Type".to_vec();
    body.extend((socket_type.len() as u32).to_be_bytes());
    body.extend(socket_type.as_bytes());
    frame_of(&body, 0x04)
}

/// A frame of a message; `more` says that another follows.
pub fn frame(body: &[u8], more: bool) -> Vec<u8> {
    frame_of(body, u8::from(more))
}

fn frame_of(body: &[u8], flags: u8) -> Vec<u8> {
    let mut bytes = match u8::try_from(body.len()) {
        Ok(length) => vec![flags, length],
        Err(_) => [&[flags | 0x02][..], &(body.len() as u64).to_be_bytes()].concat(),
    };
    bytes.extend(body);
    bytes
}

/// A message: its frames.
pub type Message = Vec<Vec<u8>>;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    Greeting,
    Ready,
    Messages,
}

/// Reads what a peer sends, from its first byte.
#[derive(Debug)]
pub struct Peer {
    stage: Stage,
    buffer: Vec<u8>,
    /// Bytes at the buffer's front that are done with.
    used: usize,
    message: Message,
}

impl Default for Peer {
    fn default() -> Self {
        Self { stage: Stage::Greeting, buffer: Vec::new(), used: 0, message: Vec::new() }
    }
}

impl Peer {
    /// Adds bytes; call [`Peer::next_message`] until it has no more before adding further ones.
    pub fn push(&mut self, bytes: &[u8]) {
        self.buffer.drain(..self.used);
        self.used = 0;
        self.buffer.extend_from_slice(bytes);
    }

    /// Bytes held.
    pub fn held(&self) -> usize {
        self.buffer.len() - self.used + self.message.iter().map(Vec::len).sum::<usize>()
    }

    /// Whether the greeting and the peer's READY have come.
    pub fn is_ready(&self) -> bool {
        self.stage == Stage::Messages
    }

    /// The next whole message. After an error the stream is of no more use.
    ///
    /// # Errors
    /// A peer that speaks something else, wants credentials, or sends more than the bounds.
    pub fn next_message(&mut self) -> Result<Option<Message>, ParseError> {
        if self.stage == Stage::Greeting && !self.read_greeting()? {
            return Ok(None);
        }
        while let Some((flags, body)) = self.read_frame()? {
            if flags & 0x04 != 0 {
                self.command(&body)?;
                continue;
            }
            if self.stage != Stage::Messages {
                return Err(ParseError::malformed("the ZeroMQ peer sends messages before READY"));
            }
            if self.message.len() == MAX_FRAMES {
                return Err(ParseError::Unsupported(format!("a ZeroMQ message of more than {MAX_FRAMES} frames")));
            }
            self.message.push(body);
            if self.held() > MAX_FRAME + (1 << 17) {
                return Err(ParseError::TooLong { what: "a ZeroMQ message", limit: MAX_FRAME });
            }
            if flags & 0x01 == 0 {
                return Ok(Some(std::mem::take(&mut self.message)));
            }
        }
        Ok(None)
    }

    fn read_greeting(&mut self) -> Result<bool, ParseError> {
        let bytes = &self.buffer[self.used..];
        let not_zmq = || ParseError::malformed("the peer does not speak ZeroMQ");
        if bytes.first().is_some_and(|byte| *byte != 0xff) || bytes.get(9).is_some_and(|byte| *byte != 0x7f) {
            return Err(not_zmq());
        }
        let Some(greeting) = bytes.get(..GREETING) else { return Ok(false) };
        if greeting[10] < 3 {
            return Err(ParseError::Unsupported(format!("ZeroMQ protocol version {}", greeting[10])));
        }
        let mechanism = greeting[12..32].split(|byte| *byte == 0).next().unwrap_or_default();
        if mechanism != b"NULL" {
            let name = super::excerpt(&String::from_utf8_lossy(mechanism));
            return Err(ParseError::Unsupported(format!("ZeroMQ security mechanism `{name}`")));
        }
        self.used += GREETING;
        self.stage = Stage::Ready;
        Ok(true)
    }

    fn read_frame(&mut self) -> Result<Option<(u8, Vec<u8>)>, ParseError> {
        let bytes = &self.buffer[self.used..];
        let Some(&flags) = bytes.first() else { return Ok(None) };
        if flags & !0x07 != 0 || flags & 0x05 == 0x05 {
            return Err(ParseError::malformed(format!("a ZeroMQ frame with flags {flags:#04x}")));
        }
        let (length, start) = if flags & 0x02 == 0 {
            let Some(&length) = bytes.get(1) else { return Ok(None) };
            (u64::from(length), 2)
        } else {
            let Some(length) = bytes.get(1..).and_then(|bytes| bytes.first_chunk::<8>()) else { return Ok(None) };
            (u64::from_be_bytes(*length), 9)
        };
        if length > MAX_FRAME as u64 {
            return Err(ParseError::TooLong { what: "a ZeroMQ frame", limit: MAX_FRAME });
        }
        let Some(body) = bytes.get(start..start + length as usize) else { return Ok(None) };
        let body = body.to_vec();
        self.used += start + body.len();
        Ok(Some((flags, body)))
    }

    fn command(&mut self, body: &[u8]) -> Result<(), ParseError> {
        let (name, rest) = body
            .split_first()
            .and_then(|(length, rest)| rest.split_at_checked(usize::from(*length)))
            .ok_or_else(|| ParseError::malformed("a ZeroMQ command without a name"))?;
        match name {
            b"READY" => self.stage = Stage::Messages,
            b"ERROR" => {
                let reason = super::excerpt(&String::from_utf8_lossy(rest.get(1..).unwrap_or_default()));
                return Err(ParseError::malformed(format!("the ZeroMQ peer refuses: {reason}")));
            }
            // Later versions have more commands; none asks for an answer from a 3.0 client.
            _ => {}
        }
        Ok(())
    }
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;

    fn messages(stream: &[u8], chunk: usize) -> Result<Vec<Message>, ParseError> {
        let mut peer = Peer::default();
        let mut found = Vec::new();
        for bytes in stream.chunks(chunk) {
            peer.push(bytes);
            while let Some(message) = peer.next_message()? {
                found.push(message);
            }
        }
        Ok(found)
    }

    fn opened() -> Vec<u8> {
        [&greeting()[..], &ready("PUB")].concat()
    }

    #[test]
    fn messages_are_read_however_the_stream_is_cut() {
        let long = vec![7_u8; 300];
        let stream = [opened(), frame(b"topic", true), frame(&long, false), frame(b"\x04PING\0\0", false)].concat();
        for chunk in [1, 5, 64, 10_000] {
            let found = messages(&stream, chunk).unwrap();
            assert_eq!(found, [vec![b"topic".to_vec(), long.clone()], vec![b"\x04PING\0\0".to_vec()]]);
        }
    }

    #[test]
    fn commands_are_not_messages() {
        let ping = frame_of(b"\x04PING\0\0", 0x04);
        let found = messages(&[opened(), ping, frame(b"x", false)].concat(), 1000).unwrap();
        assert_eq!(found, [vec![b"x".to_vec()]]);
        let refused = messages(&[opened(), frame_of(b"\x05ERROR\x03no!", 0x04)].concat(), 1000).unwrap_err();
        assert!(refused.to_string().contains("no!"));
    }

    #[test]
    fn other_peers_are_refused_with_the_reason() {
        let changed = |at: usize, value: u8| {
            let mut stream = opened();
            stream[at] = value;
            messages(&stream, 3).unwrap_err().to_string()
        };
        assert!(messages(b"HTTP/1.1 400 Bad Request\r\n", 100).unwrap_err().to_string().contains("ZeroMQ"));
        assert!(changed(9, 0).contains("ZeroMQ"));
        assert!(changed(10, 2).contains("version 2"));
        assert!(changed(12, b'C').contains("CULL"));
        assert!(changed(64, 0x40).contains("flags"));
        assert!(messages(&[&greeting()[..], &frame(b"early", false)].concat(), 9).is_err());
        assert!(messages(&[&greeting()[..], &frame_of(&[200, 1], 0x04)].concat(), 9).is_err());
    }

    #[test]
    fn frames_and_messages_are_bounded() {
        let huge = [&opened()[..], &[0x02], &u64::MAX.to_be_bytes()].concat();
        assert!(matches!(messages(&huge, 50), Err(ParseError::TooLong { .. })));
        let endless: Vec<u8> = (0..=MAX_FRAMES).flat_map(|_| frame(b"a", true)).collect();
        assert!(matches!(messages(&[opened(), endless].concat(), 50), Err(ParseError::Unsupported(_))));
        let wide: Vec<u8> = (0..3).flat_map(|_| frame(&vec![0; MAX_FRAME / 2 + 70_000], true)).collect();
        assert!(matches!(messages(&[opened(), wide].concat(), 65_536), Err(ParseError::TooLong { .. })));
    }
}
