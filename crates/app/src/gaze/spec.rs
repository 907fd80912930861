//! What a person types to name a source: `opengaze`, `lsl:name=GP3`, `trace:file.csv,loop`.

use std::borrow::Cow;
use std::fmt;
use std::path::PathBuf;
use std::str::FromStr;

use super::lsl::mapping::{Mapping, Origin, Selector, Unit};
use super::parse::lsl_info::StreamInfo;
use super::source::GazeSource;
use super::{lsl, mouse, opengaze, pupil, replay};

/// A source to be opened.
#[derive(Clone, Debug, PartialEq)]
pub enum SourceSpec {
    /// The pointer.
    Mouse,
    /// The pointer where it last rested.
    MouseDwell,
    /// A Gazepoint tracker: host and port.
    OpenGaze(String, u16),
    /// A Lab Streaming Layer stream.
    Lsl(LslSpec),
    /// Pupil Core: host, port, surface.
    Pupil(String, u16, Option<String>),
    /// A recording; `true` starts it again at its end.
    Trace(PathBuf, bool),
}

impl SourceSpec {
    /// The trackers that are looked for when nothing is said about them.
    pub fn usual_trackers() -> [Self; 3] {
        [
            Self::OpenGaze("127.0.0.1".into(), opengaze::DEFAULT_PORT),
            Self::Lsl(LslSpec::default()),
            Self::Pupil("127.0.0.1".into(), pupil::DEFAULT_PORT, None),
        ]
    }

    /// Opens the source. Devices are connected to in the background.
    ///
    /// # Errors
    /// A recording that cannot be read.
    pub fn open(&self) -> anyhow::Result<Box<dyn GazeSource>> {
        Ok(match self {
            Self::Mouse => Box::new(mouse::Mouse::default()),
            Self::MouseDwell => Box::new(mouse::Mouse::with_dwell_lock()),
            Self::OpenGaze(host, port) => Box::new(opengaze::source(host, *port)),
            Self::Lsl(spec) => Box::new(lsl::source(spec)),
            Self::Pupil(host, port, surface) => Box::new(pupil::source(host, *port, surface.as_deref())),
            Self::Trace(path, repeats) => Box::new(replay::Replay::open(path, *repeats)?),
        })
    }

    /// Whether this is the pointer, with or without dwell lock.
    pub fn is_mouse(&self) -> bool {
        matches!(self, Self::Mouse | Self::MouseDwell)
    }
}

impl fmt::Display for SourceSpec {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Mouse => f.write_str("mouse"),
            Self::MouseDwell => f.write_str("mouse-dwell"),
            Self::OpenGaze(host, port) => write!(f, "opengaze:{}:{port}", bracketed(host)),
            Self::Lsl(spec) => write!(f, "lsl{spec}"),
            Self::Pupil(host, port, None) => write!(f, "pupil:{}:{port}", bracketed(host)),
            Self::Pupil(host, port, Some(surface)) => write!(f, "pupil:{}:{port}/{surface}", bracketed(host)),
            Self::Trace(path, repeats) => write!(f, "trace:{}{}", path.display(), if *repeats { ",loop" } else { "" }),
        }
    }
}

impl FromStr for SourceSpec {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (kind, rest) = text.split_once(':').map_or((text, None), |(kind, rest)| (kind, Some(rest)));
        match (kind, rest) {
            ("mouse", None) => Ok(Self::Mouse),
            ("mouse-dwell", None) => Ok(Self::MouseDwell),
            ("opengaze", rest) => {
                let (host, port) = host_port(rest.unwrap_or_default(), opengaze::DEFAULT_PORT)?;
                Ok(Self::OpenGaze(host, port))
            }
            ("pupil", rest) => {
                let rest = rest.unwrap_or_default();
                let (address, surface) = rest.split_once('/').map_or((rest, None), |(a, s)| (a, Some(s.to_owned())));
                let (host, port) = host_port(address, pupil::DEFAULT_PORT)?;
                Ok(Self::Pupil(host, port, surface.filter(|name| !name.is_empty())))
            }
            ("lsl", rest) => Ok(Self::Lsl(rest.unwrap_or_default().parse()?)),
            ("trace", Some(rest)) if !rest.is_empty() => {
                let (path, repeats) = rest.strip_suffix(",loop").map_or((rest, false), |path| (path, true));
                Ok(Self::Trace(path.into(), repeats))
            }
            _ => Err(format!(
                "`{text}` is no gaze source; expected mouse, mouse-dwell, opengaze[:HOST[:PORT]], \
                 lsl[:name=N,type=T,...], pupil[:HOST[:PORT]][/SURFACE] or trace:FILE[,loop]"
            )),
        }
    }
}

/// A host as it stands before a port.
fn bracketed(host: &str) -> Cow<'_, str> {
    if host.contains(':') { format!("[{host}]").into() } else { host.into() }
}

fn host_port(text: &str, default_port: u16) -> Result<(String, u16), String> {
    let (host, port) = match text.rsplit_once(':') {
        // The colons of an address in brackets are its own.
        Some((host, port)) if !port.ends_with(']') => (host, port.parse().map_err(|_| format!("`{port}` is no port"))?),
        _ => (text, default_port),
    };
    let host = if host.is_empty() { "127.0.0.1" } else { host };
    Ok((host.trim_matches(['[', ']']).to_owned(), port))
}

/// A stream of the Lab Streaming Layer by what its user knows of it, and how its channels are read.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LslSpec {
    /// The stream's name.
    pub name: Option<String>,
    /// The stream's type; `Gaze` or `Eye`-something unless a name or type is given.
    pub kind: Option<String>,
    /// The only host that is asked; without, the local network is.
    pub host: Option<String>,
    /// Channels; guessed from their labels without.
    pub mapping: Option<Mapping>,
    /// As it was typed.
    text: String,
}

impl LslSpec {
    /// Whether a stream is meant.
    pub fn fits(&self, info: &StreamInfo) -> bool {
        let named = self.name.as_ref().is_none_or(|name| *name == info.name);
        let typed = match &self.kind {
            Some(kind) => kind.eq_ignore_ascii_case(&info.kind),
            None => self.name.is_some() || is_gaze(&info.kind),
        };
        named && typed
    }

    /// Channels of a stream.
    pub fn mapping(&self, info: &StreamInfo) -> Mapping {
        self.mapping.clone().unwrap_or_else(|| Mapping::guess(info))
    }
}

/// Types under which feeders publish gaze.
pub fn is_gaze(kind: &str) -> bool {
    let kind = kind.to_ascii_lowercase();
    kind.contains("gaze") || kind.contains("eye")
}

impl fmt::Display for LslSpec {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.text.is_empty() { Ok(()) } else { write!(f, ":{}", self.text) }
    }
}

impl FromStr for LslSpec {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let mut spec = Self { text: text.to_owned(), ..Self::default() };
        let mut mapping = Mapping::preset("xy").ok_or("no preset xy")?;
        let (mut x, mut y) = (None, None);
        let mut changed = false;
        for part in text.split(',').filter(|part| !part.is_empty()) {
            let (key, value) = part.split_once('=').ok_or_else(|| format!("`{part}` is not key=value"))?;
            changed |= matches!(key, "preset" | "x" | "y" | "valid" | "conf" | "unit" | "origin");
            let list = || value.split('+').map(Selector::new).collect::<Vec<_>>();
            match key {
                "name" => spec.name = Some(value.to_owned()),
                "type" => spec.kind = Some(value.to_owned()),
                "host" => spec.host = Some(value.to_owned()),
                "preset" => {
                    let known = || format!("preset `{value}`; known are {}", Mapping::PRESETS.join(", "));
                    mapping = Mapping::preset(value).ok_or_else(known)?;
                }
                "x" => x = Some(list()),
                "y" => y = Some(list()),
                "valid" => mapping.valid = list(),
                "conf" => mapping.confidence = Some(Selector::new(value)),
                "unit" => mapping.unit = unit(value)?,
                "origin" => mapping.origin = origin(value)?,
                _ => {
                    return Err(format!(
                        "`{key}`; known are name, type, host, preset, x, y, valid, conf, unit, origin"
                    ));
                }
            }
        }
        match (x, y) {
            (None, None) => {}
            (Some(x), Some(y)) if x.len() == y.len() => {
                mapping.eyes = x.into_iter().zip(y).map(<[Selector; 2]>::from).collect();
            }
            _ => return Err("x and y need as many channels each".into()),
        }
        spec.mapping = changed.then_some(mapping);
        Ok(spec)
    }
}

fn unit(text: &str) -> Result<Unit, String> {
    match text {
        "fraction" => Ok(Unit::Fraction),
        "deg" => Ok(Unit::Degrees),
        _ => {
            let size = text.strip_prefix("px:").and_then(|size| size.split_once('x'));
            let side = |text: &str| text.parse().ok().filter(|side| (1.0..=1e5).contains(side));
            size.and_then(|(width, height)| Some(Unit::Pixels([side(width)?, side(height)?])))
                .ok_or_else(|| format!("unit `{text}`; known are fraction, deg and px:WIDTHxHEIGHT"))
        }
    }
}

fn origin(text: &str) -> Result<Origin, String> {
    match text {
        "top-left" => Ok(Origin::TopLeft),
        "bottom-left" => Ok(Origin::BottomLeft),
        "centre" => Ok(Origin::Centre),
        _ => Err(format!("origin `{text}`; known are top-left, bottom-left and centre")),
    }
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;

    fn spec(text: &str) -> SourceSpec {
        text.parse().unwrap()
    }

    #[test]
    fn sources_are_read_and_written_alike() {
        for text in [
            "mouse",
            "mouse-dwell",
            "opengaze:10.0.0.5:4243",
            "pupil:127.0.0.1:50020",
            "pupil:127.0.0.1:50020/screen",
            "lsl",
            "lsl:name=GP3,x=3,y=4,unit=px:1920x1080",
            "trace:a b.csv",
            "trace:a,b.csv,loop",
        ] {
            assert_eq!(spec(text).to_string(), text);
            assert_eq!(spec(&spec(text).to_string()), spec(text));
        }
        assert_eq!(spec("opengaze"), SourceSpec::OpenGaze("127.0.0.1".into(), 4242));
        assert_eq!(spec("opengaze::4243"), SourceSpec::OpenGaze("127.0.0.1".into(), 4243));
        assert_eq!(spec("opengaze:[::1]:4243"), SourceSpec::OpenGaze("::1".into(), 4243));
        assert_eq!(spec("opengaze:[fe80::1]"), SourceSpec::OpenGaze("fe80::1".into(), 4242));
        assert_eq!(spec("pupil:[::1]/wall"), SourceSpec::Pupil("::1".into(), 50_020, Some("wall".into())));
        for text in ["opengaze:[::1]", "pupil:[::1]/wall"] {
            assert_eq!(spec(&spec(text).to_string()), spec(text));
        }
        assert_eq!(spec("pupil:/wall"), SourceSpec::Pupil("127.0.0.1".into(), 50_020, Some("wall".into())));
    }

    #[test]
    fn wrong_sources_are_refused_with_what_is_known() {
        for (text, reason) in [
            ("moose", "mouse-dwell"),
            ("trace", "trace:FILE"),
            ("mouse:1", "no gaze source"),
            ("opengaze:host:70000", "no port"),
            ("lsl:nome=x", "name, type"),
            ("lsl:name", "key=value"),
            ("lsl:preset=best", "gazepoint"),
            ("lsl:x=1", "x and y"),
            ("lsl:x=1+2,y=3", "x and y"),
            ("lsl:unit=px:0x1", "unit"),
            ("lsl:origin=top", "top-left"),
        ] {
            let error = text.parse::<SourceSpec>().unwrap_err();
            assert!(error.contains(reason), "{text}: {error}");
        }
    }

    #[test]
    fn a_stream_is_found_by_name_or_type() {
        let xml = "<info><name>GP3</name><type>Gaze</type><channel_count>2</channel_count><channel_format>float32\
            </channel_format><nominal_srate>60</nominal_srate><uid>u</uid><v4data_port>1</v4data_port>\
            <v4service_port>1</v4service_port></info>";
        let gaze = StreamInfo::from_xml(xml).unwrap();
        let eeg = StreamInfo { kind: "EEG".into(), ..gaze.clone() };
        let fits = |text: &str, info| text.parse::<LslSpec>().unwrap().fits(info);
        assert!(fits("", &gaze) && !fits("", &eeg));
        assert!(fits("name=GP3", &gaze) && fits("name=GP3", &eeg) && !fits("name=Other", &gaze));
        assert!(fits("type=eeg", &eeg) && !fits("type=eeg", &gaze) && !fits("name=GP3,type=eeg", &gaze));
    }
}
