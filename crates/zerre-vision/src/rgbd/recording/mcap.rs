//! MCAP files: pictures of two topics, those of about one time together.

use super::Source;
use super::folders::Entry;
use super::message::{Kind, Message};
use crate::{Error, Result};
use mcap::records::Record;
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader};
use std::collections::{BTreeMap, VecDeque};
use std::fmt;
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};
use zerre::Time;

/// Pictures of one topic that wait for their partner, at most.
const WAITING: usize = 64;

/// The pictures of a file, read as they are asked for.
pub(super) struct Messages {
    path: PathBuf,
    file: File,
    reader: LinearReader,
    schemas: BTreeMap<u16, String>,
    /// Of each channel that is read, what it has and whether that is depth.
    channels: BTreeMap<u16, (Kind, bool)>,
    /// All topics with their schemas, to be told.
    topics: Vec<String>,
    wanted: [Option<String>; 2],
    taken: [Option<String>; 2],
    waiting: [VecDeque<(Time, Message)>; 2],
    apart: i64,
    ended: bool,
    alone: usize,
    given: usize,
}

impl fmt::Debug for Messages {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Messages")
            .field("path", &self.path)
            .field("given", &self.given)
            .finish_non_exhaustive()
    }
}

impl Messages {
    /// `topics` names those of colours and of depth; without, the first ones whose names say it.
    ///
    /// # Errors
    /// A file that cannot be read, one without pictures of colours.
    pub(super) fn open(path: &Path, topics: &[Option<String>; 2], apart_s: f64) -> Result<Messages> {
        let refuse = |problem: String| Error::Input { input: path.display().to_string(), problem };
        let file = File::open(path).map_err(|error| refuse(format!("it cannot be read: {error}")))?;
        let mut messages = Messages {
            path: path.to_owned(),
            file,
            reader: LinearReader::new(),
            schemas: BTreeMap::new(),
            channels: BTreeMap::new(),
            topics: Vec::new(),
            wanted: topics.clone(),
            taken: [None, None],
            waiting: [VecDeque::new(), VecDeque::new()],
            apart: (apart_s * 1e9) as i64,
            ended: false,
            alone: 0,
            given: 0,
        };
        while messages.waiting[0].is_empty() && !messages.ended {
            messages.read()?;
        }
        if messages.waiting[0].is_empty() {
            let problem = format!(
                "it has no pictures of colours that can be read (foxglove.RawImage, foxglove.CompressedImage, \
                 sensor_msgs/msg/Image, sensor_msgs/msg/CompressedImage); its topics: {}",
                if messages.topics.is_empty() { "none".to_owned() } else { messages.topics.join(", ") }
            );
            return Err(refuse(problem));
        }
        Ok(messages)
    }

    pub(super) fn alone(&self) -> usize {
        self.alone
    }

    /// Reads on to the next picture, or to the end.
    fn read(&mut self) -> Result<()> {
        let Messages { path, file, reader, .. } = self;
        let refuse = |problem: String| Error::Input {
            input: path.display().to_string(),
            problem: format!("it is damaged: {problem}"),
        };
        loop {
            let event = match reader.next_event() {
                None => {
                    self.ended = true;
                    return Ok(());
                }
                Some(Err(error)) => {
                    self.ended = true;
                    return Err(refuse(error.to_string()));
                }
                Some(Ok(event)) => event,
            };
            match event {
                LinearReadEvent::ReadRequest(count) => {
                    let read = file.read(reader.insert(count));
                    let read = read.map_err(|error| {
                        self.ended = true;
                        refuse(error.to_string())
                    })?;
                    reader.notify_read(read);
                }
                LinearReadEvent::Record { data, opcode } => {
                    let record = mcap::parse_record(opcode, data).map_err(|error| {
                        self.ended = true;
                        refuse(error.to_string())
                    })?;
                    match record {
                        Record::Schema { header, .. } => {
                            self.schemas.insert(header.id, header.name);
                        }
                        Record::Channel(channel) => {
                            let schema = self.schemas.get(&channel.schema_id).map_or("", String::as_str);
                            let told = format!("{} ({schema})", channel.topic);
                            if !self.topics.contains(&told) {
                                self.topics.push(told);
                            }
                            let Some(kind) = Kind::of(schema, &channel.message_encoding) else { continue };
                            let is_depth = match &self.wanted {
                                [Some(colour), _] if *colour == channel.topic => false,
                                [_, Some(depth)] if *depth == channel.topic => true,
                                _ => channel.topic.to_lowercase().contains("depth"),
                            };
                            let role = usize::from(is_depth);
                            let wanted =
                                self.wanted[role].as_ref().is_none_or(|topic| *topic == channel.topic);
                            let taken = self.taken[role].get_or_insert_with(|| channel.topic.clone());
                            if wanted && (self.wanted[role].is_some() || *taken == channel.topic) {
                                self.channels.insert(channel.id, (kind, is_depth));
                            }
                        }
                        Record::Message { header, data } => {
                            let Some((kind, is_depth)) = self.channels.get(&header.channel_id) else {
                                continue;
                            };
                            let logged = Time::from_nanos(i64::try_from(header.log_time).unwrap_or(i64::MAX));
                            // What cannot be parsed is told as a picture that cannot be read.
                            let message = Message::parse(*kind, &data).unwrap_or_default();
                            let time = message.stamp.unwrap_or(logged);
                            self.waiting[usize::from(*is_depth)].push_back((time, message));
                            return Ok(());
                        }
                        _ => {}
                    }
                }
            }
        }
    }

    /// The next picture of colours with the nearest one of depth.
    pub(super) fn entry(&mut self) -> Option<Result<Entry>> {
        loop {
            let [colours, depths] = &self.waiting;
            let Some((time, _)) = colours.front() else {
                if self.ended {
                    self.alone += self.waiting[1].drain(..).count();
                    return None;
                }
                if let Err(error) = self.read() {
                    return Some(Err(error));
                }
                continue;
            };
            // One that comes later may be nearer to the next picture of colours: that must be known.
            let known = if colours.len() > 1 { 0 } else { self.apart };
            let late = depths.back().is_some_and(|(depth, _)| {
                let off = (*depth - *time).nanos();
                off == 0 || off >= known
            });
            if late || self.ended || colours.len() > WAITING {
                break;
            }
            if let Err(error) = self.read() {
                return Some(Err(error));
            }
        }
        let [colours, depths] = &mut self.waiting;
        let (time, colour) = colours.pop_front()?;
        let far = |depth: Time| (depth - time).nanos();
        while depths.front().is_some_and(|(depth, _)| far(*depth) < -self.apart) {
            depths.pop_front();
            self.alone += 1;
        }
        let near = depths.iter().enumerate().map(|(i, (depth, _))| (far(*depth).abs(), i)).min();
        let next = colours.front().map(|(next, _)| *next);
        let near = near.filter(|(off, i)| {
            // One that is nearer to the next picture of colours is kept for it.
            *off <= self.apart && next.is_none_or(|next| (depths[*i].0 - next).nanos().abs() >= *off)
        });
        let depth = near.and_then(|(_, i)| depths.remove(i)).map(|(_, message)| Source::Message(message));
        self.given += 1;
        let name = format!("frame {}", self.given);
        Some(Ok(Entry { name, time, colour: Some(Source::Message(colour)), depth }))
    }
}
