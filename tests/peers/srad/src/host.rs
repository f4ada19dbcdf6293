//! The host application: srad's generic application, whose stores write what they are given.

use std::collections::HashMap;

use crate::{datatype, hear, name_of, say, told, Input};
use serde_json::{json, Value};
use srad::app::generic_app::{ApplicationBuilder, MetricStore, StateUpdateError};
use srad::app::{
    MetricBirthDetails, MetricDetails, PublishMetric, PublishTopic, SubscriptionConfig,
};
use srad::client_rumqtt::{Client, EventLoop};
use srad::types::payload::{data_set::data_set_value, DataSet, DataType};
use srad::types::{MetricId, MetricValue, TemplateValue};

/// What is known of the metrics of a node or device.
struct Store {
    device: Option<String>,
    known: HashMap<MetricId, (String, DataType)>,
}

impl Store {
    fn new(device: Option<String>) -> Self {
        Store {
            device,
            known: HashMap::new(),
        }
    }
}

impl MetricStore for Store {
    fn set_stale(&mut self) {
        say("death", self.device.as_deref(), vec![]);
    }

    fn update_from_birth(
        &mut self,
        details: Vec<(MetricBirthDetails, MetricDetails)>,
    ) -> Result<(), StateUpdateError> {
        let mut lines = Vec::new();
        for (birth, metric) in details {
            self.known
                .insert(birth.get_metric_id(), (birth.name.clone(), birth.datatype));
            let value = told(birth.datatype, metric.value);
            lines.push(json!({"name": birth.name, "alias": birth.alias, "type": name_of(birth.datatype), "value": value}));
        }
        say("birth", self.device.as_deref(), lines);
        Ok(())
    }

    fn update_from_data(
        &mut self,
        details: Vec<(MetricId, MetricDetails)>,
    ) -> Result<(), StateUpdateError> {
        let mut lines = Vec::new();
        for (id, metric) in details {
            let (name, kind) = self.known.get(&id).ok_or(StateUpdateError::UnknownMetric)?;
            lines.push(
                json!({"name": name, "type": name_of(*kind), "value": told(*kind, metric.value)}),
            );
        }
        say("data", self.device.as_deref(), lines);
        Ok(())
    }
}

/// Return a table as a test writes it.
pub fn table(table: DataSet) -> Value {
    let cell = |value: data_set_value::Value| match value {
        data_set_value::Value::IntValue(v) => v.to_string(),
        data_set_value::Value::LongValue(v) => v.to_string(),
        data_set_value::Value::FloatValue(v) => v.to_string(),
        data_set_value::Value::DoubleValue(v) => v.to_string(),
        data_set_value::Value::BooleanValue(v) => v.to_string(),
        data_set_value::Value::StringValue(v) => v,
        other => format!("{other:?}"),
    };
    let rows: Vec<Vec<Option<String>>> = table
        .rows
        .into_iter()
        .map(|row| {
            row.elements
                .into_iter()
                .map(|one| one.value.map(cell))
                .collect()
        })
        .collect();
    json!({"columns": table.columns, "rows": rows})
}

/// Return a template as a test writes it.
pub fn template(value: TemplateValue) -> Value {
    match value {
        TemplateValue::Definition(definition) => {
            json!({"definition": true, "ref": null, "metrics": definition.metrics.len()})
        }
        TemplateValue::Instance(instance) => {
            let members: Vec<Value> = instance
                .metrics
                .into_iter()
                .map(|member| {
                    let kind = member.datatype.and_then(|code| DataType::try_from(code).ok()).unwrap_or(DataType::Unknown);
                    json!({"name": member.name, "value": told(kind, member.value.map(MetricValue::new))})
                })
                .collect();
            json!({"definition": false, "ref": instance.template_ref, "metrics": members})
        }
    }
}

fn published(line: &Value) -> PublishMetric {
    let id = match line["alias"].as_u64() {
        Some(alias) => MetricId::Alias(alias),
        None => MetricId::Name(line["name"].as_str().unwrap().to_string()),
    };
    let text = line["value"].as_str().unwrap();
    match datatype(line["type"].as_str().unwrap()) {
        DataType::Boolean => PublishMetric::new(id, text == "true"),
        DataType::Int32 => PublishMetric::new(id, text.parse::<i32>().unwrap()),
        other => panic!("no test commands a {}", name_of(other)),
    }
}

pub async fn run(
    eventloop: EventLoop,
    client: Client,
    group: &str,
    host_id: &str,
    mut input: Input,
) {
    let groups = SubscriptionConfig::SingleGroup {
        group_id: group.to_string(),
    };
    let (application, client) = ApplicationBuilder::new(host_id, eventloop, client, groups)
        .on_node_created(|node| {
            node.register_metric_store(Store::new(None));
            node.on_device_created(|device| {
                let name = device.name().to_string();
                device.register_metric_store(Store::new(Some(name)));
            });
        })
        .build();
    let running = tokio::spawn(application.run());
    say("started", None, vec![]);
    while let Some(line) = hear(&mut input).await {
        let node = line["node"].as_str().unwrap_or_default();
        match line["do"].as_str().unwrap() {
            "rebirth" => _ = client.publish_node_rebirth(group, node).await,
            "write" => {
                let topic =
                    PublishTopic::new_device_cmd(group, node, line["device"].as_str().unwrap());
                _ = client
                    .publish_metrics(
                        topic,
                        line["metrics"]
                            .as_array()
                            .unwrap()
                            .iter()
                            .map(published)
                            .collect(),
                    )
                    .await;
            }
            _ => {
                client.cancel().await;
                break;
            }
        }
    }
    _ = running.await;
}
