//! MessagePack, as far as a message of named numbers needs it. Values are read in place; nothing is allocated.

use super::ParseError;

/// Containers inside containers that are followed.
pub const MAX_DEPTH: u32 = 32;

/// One value; containers give their number of elements, which follow in the input.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Value<'a> {
    /// Nil.
    Nil,
    /// A truth value.
    Bool(bool),
    /// Any number; integers beyond 2^53 are rounded.
    Number(f64),
    /// Text, or bytes that older writers use for text.
    Text(&'a [u8]),
    /// So many values follow.
    Array(usize),
    /// So many pairs of values follow.
    Map(usize),
    /// An extension type, which is passed over.
    Extension(i8),
}

/// Reads values one after the other.
#[derive(Clone, Debug)]
pub struct Reader<'a> {
    rest: &'a [u8],
}

impl<'a> Reader<'a> {
    /// From the first byte of a value.
    pub fn new(bytes: &'a [u8]) -> Self {
        Self { rest: bytes }
    }

    /// The next value.
    ///
    /// # Errors
    /// The input ends within it, or it begins with the byte that has no meaning.
    pub fn next_value(&mut self) -> Result<Value<'a>, ParseError> {
        let [tag] = self.take()?;
        Ok(match tag {
            0x00..=0x7f => Value::Number(tag.into()),
            0x80..=0x8f => Value::Map(usize::from(tag & 0x0f)),
            0x90..=0x9f => Value::Array(usize::from(tag & 0x0f)),
            0xa0..=0xbf => Value::Text(self.bytes(usize::from(tag & 0x1f))?),
            0xc0 => Value::Nil,
            0xc1 => return Err(ParseError::malformed("a msgpack value of a type that does not exist")),
            0xc2 => Value::Bool(false),
            0xc3 => Value::Bool(true),
            0xc4 | 0xd9 => self.text(1)?,
            0xc5 | 0xda => self.text(2)?,
            0xc6 | 0xdb => self.text(4)?,
            0xc7 => self.extension(1)?,
            0xc8 => self.extension(2)?,
            0xc9 => self.extension(4)?,
            0xca => Value::Number(f32::from_be_bytes(self.take()?).into()),
            0xcb => Value::Number(f64::from_be_bytes(self.take()?)),
            0xcc => Value::Number(u8::from_be_bytes(self.take()?).into()),
            0xcd => Value::Number(u16::from_be_bytes(self.take()?).into()),
            0xce => Value::Number(u32::from_be_bytes(self.take()?).into()),
            0xcf => Value::Number(u64::from_be_bytes(self.take()?) as f64),
            0xd0 => Value::Number(i8::from_be_bytes(self.take()?).into()),
            0xd1 => Value::Number(i16::from_be_bytes(self.take()?).into()),
            0xd2 => Value::Number(i32::from_be_bytes(self.take()?).into()),
            0xd3 => Value::Number(i64::from_be_bytes(self.take()?) as f64),
            0xd4..=0xd8 => self.extension_of(1 << (tag - 0xd4))?,
            0xdc => Value::Array(self.length(2)?),
            0xdd => Value::Array(self.length(4)?),
            0xde => Value::Map(self.length(2)?),
            0xdf => Value::Map(self.length(4)?),
            0xe0..=0xff => Value::Number(tag.cast_signed().into()),
        })
    }

    /// Passes over the next value with all that is in it.
    ///
    /// # Errors
    /// As [`Reader::next_value`], or containers nested deeper than [`MAX_DEPTH`].
    pub fn skip(&mut self) -> Result<(), ParseError> {
        // Elements still to come at each level; a list of levels instead of recursion bounds the stack.
        let mut levels = [0_usize; MAX_DEPTH as usize];
        let mut depth = 0;
        loop {
            let inside = match self.next_value()? {
                Value::Array(count) => count,
                // A map of 2^63 pairs cannot be in the input, so saturating does not change what is accepted.
                Value::Map(count) => count.saturating_mul(2),
                _ => 0,
            };
            if inside > 0 {
                let level = levels.get_mut(depth).ok_or(ParseError::Unsupported("msgpack nested too deeply".into()))?;
                *level = inside;
                depth += 1;
                continue;
            }
            loop {
                if depth == 0 {
                    return Ok(());
                }
                levels[depth - 1] -= 1;
                if levels[depth - 1] > 0 {
                    break;
                }
                depth -= 1;
            }
        }
    }

    /// The next value as a number; another value is passed over and gives `None`.
    ///
    /// # Errors
    /// As [`Reader::skip`].
    pub fn number(&mut self) -> Result<Option<f64>, ParseError> {
        let start = self.rest;
        match self.next_value()? {
            Value::Number(value) => Ok(Some(value)),
            _ => {
                self.rest = start;
                self.skip().map(|()| None)
            }
        }
    }

    fn text(&mut self, length_size: usize) -> Result<Value<'a>, ParseError> {
        let length = self.length(length_size)?;
        Ok(Value::Text(self.bytes(length)?))
    }

    fn extension(&mut self, length_size: usize) -> Result<Value<'a>, ParseError> {
        let length = self.length(length_size)?;
        self.extension_of(length)
    }

    fn extension_of(&mut self, length: usize) -> Result<Value<'a>, ParseError> {
        let [kind] = self.take()?;
        self.bytes(length)?;
        Ok(Value::Extension(kind.cast_signed()))
    }

    fn length(&mut self, size: usize) -> Result<usize, ParseError> {
        Ok(self.bytes(size)?.iter().fold(0, |length, &byte| length << 8 | usize::from(byte)))
    }

    fn take<const N: usize>(&mut self) -> Result<[u8; N], ParseError> {
        let (bytes, rest) = self.rest.split_first_chunk::<N>().ok_or_else(cut)?;
        self.rest = rest;
        Ok(*bytes)
    }

    fn bytes(&mut self, count: usize) -> Result<&'a [u8], ParseError> {
        let (bytes, rest) = self.rest.split_at_checked(count).ok_or_else(cut)?;
        self.rest = rest;
        Ok(bytes)
    }
}

fn cut() -> ParseError {
    ParseError::malformed("a msgpack value is cut off")
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;

    #[test]
    fn every_type_is_read_as_the_specification_has_it() {
        for (bytes, value) in [
            (&[0x07][..], Value::Number(7.0)),
            (&[0xff], Value::Number(-1.0)),
            (&[0xc0], Value::Nil),
            (&[0xc2], Value::Bool(false)),
            (&[0xc3], Value::Bool(true)),
            (&[0xcc, 200], Value::Number(200.0)),
            (&[0xcd, 1, 0], Value::Number(256.0)),
            (&[0xce, 0, 1, 0, 0], Value::Number(65_536.0)),
            (&[0xcf, 0, 0, 0, 1, 0, 0, 0, 0], Value::Number(4_294_967_296.0)),
            (&[0xd0, 0x80], Value::Number(-128.0)),
            (&[0xd1, 0xff, 0xfe], Value::Number(-2.0)),
            (&[0xd2, 0xff, 0xff, 0xff, 0xfd], Value::Number(-3.0)),
            (&[0xd3, 255, 255, 255, 255, 255, 255, 255, 252], Value::Number(-4.0)),
            (&[0xca, 0x3f, 0xc0, 0, 0], Value::Number(1.5)),
            (&[0xcb, 0x3f, 0xf8, 0, 0, 0, 0, 0, 0], Value::Number(1.5)),
            (&[0xa2, b'o', b'k'], Value::Text(b"ok")),
            (&[0xd9, 1, b'x'], Value::Text(b"x")),
            (&[0xc5, 0, 1, b'y'], Value::Text(b"y")),
            (&[0xdb, 0, 0, 0, 1, b'z'], Value::Text(b"z")),
            (&[0x93, 1, 2, 3], Value::Array(3)),
            (&[0xdc, 1, 0], Value::Array(256)),
            (&[0xdd, 0, 1, 0, 0], Value::Array(65_536)),
            (&[0x81, 1, 2], Value::Map(1)),
            (&[0xde, 0, 5], Value::Map(5)),
            (&[0xdf, 0, 0, 0, 5], Value::Map(5)),
            (&[0xd5, 9, 1, 2], Value::Extension(9)),
            (&[0xc7, 1, 0xff, 0], Value::Extension(-1)),
            (&[0xc8, 0, 1, 3, 0], Value::Extension(3)),
            (&[0xc9, 0, 0, 0, 1, 3, 0], Value::Extension(3)),
        ] {
            assert_eq!(Reader::new(bytes).next_value().unwrap(), value, "{bytes:x?}");
            let whole = !matches!(value, Value::Array(_) | Value::Map(_));
            assert!(!whole || Reader::new(&bytes[..bytes.len() - 1]).next_value().is_err(), "{bytes:x?}");
        }
        assert!(Reader::new(&[0xc1]).next_value().is_err());
    }

    #[test]
    fn values_are_passed_over_whole() {
        // {"a": [1, {"b": ext}], 2: nil}, then 5.
        let bytes = [0x82, 0xa1, b'a', 0x92, 1, 0x81, 0xa1, b'b', 0xd4, 7, 0, 2, 0xc0, 5];
        let mut reader = Reader::new(&bytes);
        reader.skip().unwrap();
        assert_eq!(reader.number().unwrap(), Some(5.0));
        assert!(reader.skip().is_err(), "nothing is left");
    }

    #[test]
    fn nesting_and_false_lengths_are_bounded() {
        let nested = [0x91_u8; 1000];
        assert!(matches!(Reader::new(&nested).skip(), Err(ParseError::Unsupported(_))));
        assert!(Reader::new(&[0xdd, 255, 255, 255, 255, 1]).skip().is_err());
        assert!(Reader::new(&[0xdf, 255, 255, 255, 255]).skip().is_err());
        assert!(Reader::new(&[0xc6, 255, 255, 255, 255, 1]).skip().is_err());
        assert_eq!(Reader::new(&[0x90]).number().unwrap(), None);
    }
}
