//! What `zerre init` and `zerre schema` hand out.

use super::track::TrackConfig;
use crate::command::fuse::FuseConfig;
use schemars::{Schema, schema_for};
use zerre_lab::scenario::Scenario;
use zerre_lab::study::spec::Spec;

/// Kinds of configuration that there are.
pub const KINDS: [&str; 4] = ["track", "scenario", "study", "fuse"];

/// The commented starter file of a kind.
pub fn starter(kind: &str) -> Option<&'static str> {
    match kind {
        "track" => Some(include_str!("track.toml")),
        "scenario" => Some(include_str!("scenario.toml")),
        "study" => Some(include_str!("study.toml")),
        "fuse" => Some(include_str!("fuse.toml")),
        _ => None,
    }
}

/// The JSON Schema of a kind.
pub fn schema(kind: &str) -> Option<Schema> {
    match kind {
        "track" => Some(schema_for!(TrackConfig)),
        "scenario" => Some(schema_for!(Scenario)),
        "study" => Some(schema_for!(Spec)),
        "fuse" => Some(schema_for!(FuseConfig)),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::{Effective, Source};
    use serde_json::Value;

    /// The starter with every setting switched on.
    fn switched_on() -> String {
        let line = |line: &'static str| match line.strip_prefix('#') {
            Some(setting) if !setting.is_empty() && !setting.starts_with(' ') => setting,
            _ => line,
        };
        starter("track").unwrap().lines().map(line).collect::<Vec<_>>().join("\n")
    }

    fn settled(config: &TrackConfig) -> Effective {
        let mut effective = Effective::default();
        config.input.settle(&mut effective);
        config.filter.settle_particles("particle", &mut effective);
        config.start.settle(&mut effective);
        config.life.settle(&mut effective);
        config.extended.clone().unwrap_or_default().settle(&mut effective);
        effective
    }

    #[test]
    fn there_is_a_starter_and_a_schema_for_every_kind_and_no_other() {
        for kind in KINDS {
            assert!(starter(kind).is_some() && schema(kind).is_some());
        }
        assert!(starter("otb").is_none() && schema("otb").is_none());
    }

    #[test]
    fn the_starter_of_a_scenario_is_one() {
        let source = Source::new("scenario.toml", starter("scenario").unwrap());
        let scenario: Scenario = source.parse().unwrap();
        assert_eq!(scenario.check(), Ok(()));
        assert!(!scenario.draw(1, 0).unwrap().measurements.is_empty());
        let schema = serde_json::to_value(schema("scenario").unwrap()).unwrap();
        for key in schema["properties"].as_object().unwrap().keys() {
            assert!(starter("scenario").unwrap().contains(key.as_str()), "{key} is not in the starter");
        }
    }

    /// Every setting is in it, with the value that it has anyway.
    #[test]
    fn the_starter_of_a_fusion_changes_nothing() {
        let config: FuseConfig = Source::new("fuse.toml", starter("fuse").unwrap()).parse().unwrap();
        assert_eq!(config, FuseConfig::default());
        let value = |config: &FuseConfig| serde_json::to_value(config).unwrap();
        let mut left_out = Vec::new();
        let mut pending = vec![value(&config)];
        while let Some(value) = pending.pop() {
            match value {
                Value::Object(fields) => {
                    for (key, value) in fields {
                        if !starter("fuse").unwrap().contains(key.as_str()) {
                            left_out.push(key);
                        }
                        pending.push(value);
                    }
                }
                Value::Array(values) => pending.extend(values),
                _ => {}
            }
        }
        assert!(left_out.is_empty(), "{left_out:?}");
    }

    /// What is learnt is written into it: other values in their places, each source in a table of its own.
    #[test]
    fn the_starter_of_a_fusion_takes_other_values() {
        let mut config = FuseConfig { without: vec!["depth".to_owned()], ..FuseConfig::default() };
        let tracker = &mut config.tracker;
        let mut other = tracker.sources[0].clone();
        (other.name, other.offset, other.outlier) = ("pose \"two\"".to_owned(), [-3.25, 1e-7], 1.5e-5);
        tracker.sources.push(other);
        (tracker.fusion.particles, tracker.reference_sd) = (333, 2.0);
        let text = crate::config::filled(starter("fuse").unwrap(), &serde_json::to_value(&config).unwrap());
        assert_eq!(Source::new("fuse.toml", text).parse::<FuseConfig>().unwrap(), config);
    }

    #[test]
    fn the_starter_of_a_study_is_one_and_shows_every_key() {
        let text = starter("study").unwrap();
        let spec: Spec = Source::new("study.toml", text).parse().unwrap();
        assert!(spec.comparison(1).is_ok());
        let schema = serde_json::to_value(schema("study").unwrap()).unwrap();
        let table: toml::Value = toml::from_str(text).unwrap();
        assert!(accepts(&schema, &schema, &table));
        assert!(!accepts(&schema, &schema, &toml::from_str("[[filter]]\nother = 1").unwrap()));
        for table in schema["$defs"].as_object().unwrap().values().chain([&schema]) {
            for key in table["properties"].as_object().into_iter().flat_map(|keys| keys.keys()) {
                assert!(text.contains(key.as_str()), "{key} is not in the starter");
            }
        }
    }

    #[test]
    fn the_starter_changes_nothing() {
        let config = TrackConfig::from_source(&Source::new("starter", starter("track").unwrap())).unwrap();
        assert_eq!(config, TrackConfig::default());
    }

    #[test]
    fn the_settings_of_the_starter_are_the_defaults() {
        let text = switched_on();
        let config = TrackConfig::from_source(&Source::new("starter", text.clone())).unwrap();
        let shown = settled(&config);
        for row in settled(&TrackConfig::default()).rows() {
            let there = shown.rows().iter().find(|other| other.path == row.path).unwrap();
            assert_eq!(there.value, row.value, "{:?}", row.path);
            assert!(matches!(there.reason, crate::config::Reason::Given(_)), "{:?} is missing", row.path);
        }
        let choices = (config.filter.name.as_deref(), config.motion.model.as_deref());
        assert_eq!(choices, (Some("auto"), Some("auto")));
    }

    /// Whether every key of `value` is a property of the schema, following references and alternatives; a name in
    /// `visited` for each property met.
    fn accepts(root: &Value, schema: &Value, value: &toml::Value) -> bool {
        if let Some(name) = schema["$ref"].as_str() {
            let target = root.pointer(name.trim_start_matches('#')).unwrap();
            return accepts(root, target, value);
        }
        for alternatives in ["anyOf", "oneOf"] {
            if let Some(list) = schema[alternatives].as_array() {
                return list.iter().any(|schema| accepts(root, schema, value));
            }
        }
        let types = match &schema["type"] {
            Value::String(one) => vec![one.as_str()],
            Value::Array(several) => several.iter().filter_map(Value::as_str).collect(),
            _ => vec!["string"], // a `const` or an `enum` of words
        };
        match value {
            toml::Value::Table(table) => {
                types.contains(&"object")
                    && table.iter().all(|(key, value)| match schema["properties"].get(key) {
                        Some(inner) => accepts(root, inner, value),
                        None => {
                            schema["additionalProperties"].is_object()
                                && accepts(root, &schema["additionalProperties"], value)
                        }
                    })
            }
            toml::Value::Array(items) => {
                types.contains(&"array") && items.iter().all(|item| accepts(root, &schema["items"], item))
            }
            toml::Value::String(_) => types.contains(&"string"),
            toml::Value::Float(_) => types.contains(&"number"),
            toml::Value::Integer(_) => types.contains(&"integer") || types.contains(&"number"),
            _ => false,
        }
    }

    #[test]
    fn the_schema_accepts_the_starter_and_refuses_other_keys() {
        let schema = serde_json::to_value(schema("track").unwrap()).unwrap();
        let table: toml::Value = toml::from_str(&switched_on()).unwrap();
        assert!(accepts(&schema, &schema, &table));
        for wrong in
            ["other = 1", "[filter]\nother = 1", "[sensor.a]\nother = 1", "[track]\nmax_gap_s = \"x\""]
        {
            assert!(!accepts(&schema, &schema, &toml::from_str(wrong).unwrap()), "{wrong}");
        }
        let short: toml::Value = toml::from_str("filter = \"particle\"").unwrap();
        assert!(accepts(&schema, &schema, &short));
    }

    #[test]
    fn the_starter_shows_every_key() {
        let schema = serde_json::to_value(schema("track").unwrap()).unwrap();
        let text = switched_on();
        let definitions = schema["$defs"].as_object().unwrap().values();
        for table in definitions.chain([&schema]) {
            for key in table["properties"].as_object().into_iter().flat_map(|keys| keys.keys()) {
                assert!(text.contains(key.as_str()), "{key} is not in the starter");
            }
        }
    }
}
