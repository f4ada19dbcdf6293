//! The edge node: srad's EoN with one device, whose metrics are those that the test declares.

use std::collections::HashMap;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use crate::{datatype, hear, say, Input};
use async_trait::async_trait;
use serde_json::{json, Value};
use srad::client_rumqtt::{Client, EventLoop};
use srad::eon::{
    AliasConfig, BirthInitializer, BirthMetricDetails, DeviceHandle, DeviceMetricManager,
    EoNBuilder, MessageMetrics, MetricManager, MetricPublisher, NodeHandle, NodeMetricManager,
    PublishMetric,
};
use srad::types::payload::metric;
use srad::types::{traits, DateTime, MetricId, PropertySet, Template, TemplateMetadata};

const DEVICE: &str = "lathe";

type Publisher = Box<dyn Fn(&Value) -> PublishMetric + Send + Sync>;

/// The template of the test.
#[derive(Template)]
struct Axis {
    load: f64,
}

impl TemplateMetadata for Axis {
    fn template_name() -> &'static str {
        "Axis"
    }
}

/// The metrics of the node or of the device, and how each is published.
#[derive(Default)]
struct Declared {
    device: Option<&'static str>,
    lines: Vec<Value>,
    publishers: Mutex<HashMap<String, Publisher>>,
}

struct Manager(Arc<Declared>);

impl Manager {
    fn register<T>(&self, birth: &mut BirthInitializer, line: &Value, parse: fn(&str) -> T)
    where
        T: traits::MetricValue + Send + Sync + 'static,
    {
        let (name, kind) = (
            line["name"].as_str().unwrap(),
            datatype(line["type"].as_str().unwrap()),
        );
        let mut details = match line["value"].as_str() {
            Some(text) => {
                BirthMetricDetails::new_with_initial_value_explicit_type(name, parse(text), kind)
                    .unwrap()
            }
            None => BirthMetricDetails::<T>::new_without_initial_value(name, kind).unwrap(),
        };
        details = details.with_alias_config(
            line["alias"]
                .as_u64()
                .map_or(AliasConfig::None, AliasConfig::Custom),
        );
        if let Some(unit) = line["unit"].as_str() {
            let mut properties = PropertySet::new();
            properties
                .insert("engUnit", Some(unit.to_string()))
                .unwrap();
            details = details.with_properties(properties);
        }
        let token = birth.register_metric(details).unwrap();
        let publisher: Publisher =
            Box::new(move |line| token.create_publish_metric(line["value"].as_str().map(parse)));
        self.0
            .publishers
            .lock()
            .unwrap()
            .insert(name.to_string(), publisher);
    }
}

impl MetricManager for Manager {
    fn initialise_birth(&self, birth: &mut BirthInitializer) {
        for line in &self.0.lines {
            match line["type"].as_str().unwrap() {
                "Int8" => self.register::<i8>(birth, line, |text| text.parse().unwrap()),
                "Int16" => self.register::<i16>(birth, line, |text| text.parse().unwrap()),
                "Int32" => self.register::<i32>(birth, line, |text| text.parse().unwrap()),
                "Int64" => self.register::<i64>(birth, line, |text| text.parse().unwrap()),
                "UInt8" => self.register::<u8>(birth, line, |text| text.parse().unwrap()),
                "UInt16" => self.register::<u16>(birth, line, |text| text.parse().unwrap()),
                "UInt32" => self.register::<u32>(birth, line, |text| text.parse().unwrap()),
                "UInt64" => self.register::<u64>(birth, line, |text| text.parse().unwrap()),
                "Float" => self.register::<f32>(birth, line, |text| text.parse().unwrap()),
                "Double" => self.register::<f64>(birth, line, |text| text.parse().unwrap()),
                "Boolean" => self.register::<bool>(birth, line, |text| text == "true"),
                "String" | "Text" => self.register::<String>(birth, line, |text| text.to_string()),
                "DateTime" => self
                    .register::<DateTime>(birth, line, |text| DateTime::new(text.parse().unwrap())),
                "Bytes" => self.register::<Vec<u8>>(birth, line, |text| {
                    (0..text.len())
                        .step_by(2)
                        .map(|at| u8::from_str_radix(&text[at..at + 2], 16).unwrap())
                        .collect()
                }),
                "Template" if line["value"]["definition"] == json!(true) => {} // srad registers it by itself
                "Template" => {
                    let load = line["value"]["metrics"][0]["value"]
                        .as_str()
                        .unwrap()
                        .parse()
                        .unwrap();
                    let details = BirthMetricDetails::new_template_metric(
                        line["name"].as_str().unwrap(),
                        Axis { load },
                    );
                    birth.register_template_metric(details).unwrap();
                }
                other => panic!("srad has no {other}"),
            }
        }
    }
}

fn commanded(declared: &Declared, metrics: MessageMetrics) {
    let lines = metrics.into_iter().map(|one| {
        let (name, alias) = match one.id {
            MetricId::Name(name) => (Some(name), None),
            MetricId::Alias(alias) => (None, Some(alias)),
        };
        let value = one.value.map(|value| match value.0 {
            metric::Value::IntValue(v) => v.to_string(),
            metric::Value::LongValue(v) => v.to_string(),
            metric::Value::BooleanValue(v) => v.to_string(),
            other => format!("{other:?}"),
        });
        json!({"name": name, "alias": alias, "value": value})
    });
    say("command", declared.device, lines.collect());
}

#[async_trait]
impl NodeMetricManager for Manager {
    async fn on_ncmd(&self, _: NodeHandle, metrics: MessageMetrics) {
        commanded(&self.0, metrics);
    }
}

#[async_trait]
impl DeviceMetricManager for Manager {
    async fn on_dcmd(&self, _: DeviceHandle, metrics: MessageMetrics) {
        commanded(&self.0, metrics);
    }
}

pub async fn run(eventloop: EventLoop, client: Client, group: &str, name: &str, mut input: Input) {
    let lines = hear(&mut input).await.unwrap();
    let of = |owner: &str, device| {
        let lines = lines[owner].as_array().unwrap().clone();
        Arc::new(Declared {
            device,
            lines,
            ..Declared::default()
        })
    };
    let (own, declared) = (of("node", None), of("device", Some(DEVICE)));
    let (eon, node) = EoNBuilder::new(eventloop, client)
        .with_group_id(group)
        .with_node_id(name)
        .with_rebirth_cmd_cooldown(Duration::from_millis(100))
        .with_metric_manager(Manager(own))
        .register_template::<Axis>()
        .build()
        .unwrap();
    let device = node
        .register_device(DEVICE, Manager(declared.clone()))
        .unwrap();
    device.enable();
    let running = tokio::spawn(eon.run());
    say("started", None, vec![]);
    let made =
        |line: &Value| declared.publishers.lock().unwrap()[line["name"].as_str().unwrap()](line);
    while let Some(line) = hear(&mut input).await {
        match line["do"].as_str().unwrap() {
            "data" => {
                let metrics: Vec<PublishMetric> = line["metrics"]
                    .as_array()
                    .unwrap()
                    .iter()
                    .map(made)
                    .collect();
                _ = device.publish_metrics(metrics).await;
            }
            "run" => {
                for number in 1..=line["count"].as_u64().unwrap() {
                    let mut metric = line["metric"].clone();
                    metric["value"] = json!(number.to_string());
                    _ = device.publish_metric(made(&metric)).await;
                }
            }
            "device death" => device.disable(),
            "device birth" => device.enable(),
            _ => {
                node.cancel().await;
                break;
            }
        }
    }
    _ = running.await;
}
