import com.fasterxml.jackson.databind.JsonNode;
import com.fasterxml.jackson.databind.ObjectMapper;
import com.fasterxml.jackson.databind.node.ObjectNode;
import java.util.ArrayList;
import java.util.Date;
import java.util.List;
import org.eclipse.paho.client.mqttv3.MqttMessage;
import org.eclipse.tahu.edge.EdgeClient;
import org.eclipse.tahu.edge.api.MetricHandler;
import org.eclipse.tahu.message.SparkplugBPayloadDecoder;
import org.eclipse.tahu.message.SparkplugBPayloadEncoder;
import org.eclipse.tahu.message.model.EdgeNodeDescriptor;
import org.eclipse.tahu.message.model.MessageType;
import org.eclipse.tahu.message.model.Metric;
import org.eclipse.tahu.message.model.Metric.MetricBuilder;
import org.eclipse.tahu.message.model.MetricDataType;
import org.eclipse.tahu.message.model.SparkplugBPayload;
import org.eclipse.tahu.message.model.SparkplugBPayloadMap;
import org.eclipse.tahu.message.model.SparkplugDescriptor;
import org.eclipse.tahu.message.model.SparkplugMeta;
import org.eclipse.tahu.message.model.StatePayload;
import org.eclipse.tahu.message.model.Topic;
import org.eclipse.tahu.model.MetricDataTypeMap;
import org.eclipse.tahu.model.MqttServerDefinition;
import org.eclipse.tahu.mqtt.ClientCallback;
import org.eclipse.tahu.mqtt.MqttClientId;
import org.eclipse.tahu.mqtt.MqttServerName;
import org.eclipse.tahu.mqtt.MqttServerUrl;

/** Tahu's EdgeClient with one device; it asks the program for its births and its death, as the package has it. */
final class Edge implements Peer.Role, MetricHandler, ClientCallback {

    private static final String DEVICE = "lathe";

    private final EdgeNodeDescriptor node;
    private final JsonNode declared;
    private final EdgeClient client;
    private long deathBdSeq = 0;
    private long birthBdSeq = 0;

    Edge(final String url, final String group, final String name, final String primary, final JsonNode declared) throws Exception {
        this.node = new EdgeNodeDescriptor(group, name);
        this.declared = declared;
        final MqttServerDefinition server = new MqttServerDefinition(
                new MqttServerName("broker"), new MqttClientId("tahu-" + name, false), new MqttServerUrl(url), null, null, 30, getDeathTopic());
        final List<String> devices = new ArrayList<>(List.of(DEVICE));
        client = new EdgeClient(this, node, devices, primary.isEmpty() ? null : primary, true, 100L, List.of(server), this, null);
        new Thread(client).start();
    }

    @Override
    public boolean told(final JsonNode line) throws Exception {
        switch (line.get("do").asText()) {
            case "data" -> client.publishDeviceData(DEVICE, payload(Peer.metrics(line.get("metrics"))));
            case "run" -> {
                for (int number = 1; number <= line.get("count").asInt(); number++) {
                    final ObjectNode metric = line.get("metric").deepCopy();
                    client.publishDeviceData(DEVICE, payload(List.of(Peer.metric(metric.put("value", String.valueOf(number))))));
                }
            }
            case "device death" -> client.publishDeviceDeath(DEVICE);
            case "device birth" -> birthOfDevice();
            default -> {
                client.shutdown();
                return false;
            }
        }
        return true;
    }

    private static SparkplugBPayload payload(final List<Metric> metrics) {
        return new SparkplugBPayload(new Date(), new ArrayList<>(metrics));
    }

    private void birthOfDevice() throws Exception {
        client.publishDeviceBirth(DEVICE, payload(Peer.metrics(declared.get("device"))));
    }

    @Override
    public Topic getDeathTopic() {
        return new Topic(SparkplugMeta.SPARKPLUG_B_TOPIC_PREFIX, node.getGroupId(), node.getEdgeNodeId(), MessageType.NDEATH);
    }

    @Override
    public byte[] getDeathPayloadBytes() throws Exception {
        birthBdSeq = deathBdSeq;
        final SparkplugBPayload death = payload(List.of(bdSeq(birthBdSeq)));
        deathBdSeq = (deathBdSeq + 1) % 256;
        return new SparkplugBPayloadEncoder().getBytes(death, true);
    }

    private static Metric bdSeq(final long number) {
        try {
            return new MetricBuilder("bdSeq", MetricDataType.Int64, number).timestamp(new Date()).createMetric();
        } catch (final Exception error) {
            throw new IllegalStateException(error);
        }
    }

    @Override
    public void publishBirthSequence() {
        try {
            final SparkplugBPayloadMap birth = new SparkplugBPayloadMap();
            birth.setTimestamp(new Date());
            birth.addMetrics(Peer.metrics(declared.get("node")));
            birth.addMetric(new MetricBuilder(SparkplugMeta.METRIC_NODE_REBIRTH, MetricDataType.Boolean, false)
                    .timestamp(new Date())
                    .createMetric());
            birth.addMetric(bdSeq(birthBdSeq));
            client.publishNodeBirth(birth);
            birthOfDevice();
        } catch (final Exception error) {
            error.printStackTrace();
        }
    }

    @Override
    public boolean hasMetric(final SparkplugDescriptor descriptor, final String name) {
        for (final JsonNode metric : declared.get(descriptor.isDeviceDescriptor() ? "device" : "node")) {
            if (metric.get("name").asText().equals(name)) {
                return true;
            }
        }
        return SparkplugMeta.METRIC_NODE_REBIRTH.equals(name);
    }

    @Override
    public void messageArrived(
            final MqttServerName server, final MqttServerUrl url, final MqttClientId id, final String raw, final MqttMessage message) {
        try {
            final Topic topic = Topic.parseTopic(raw);
            if (topic.isType(MessageType.STATE)) {
                client.handleStateMessage(topic.getHostApplicationId(), new ObjectMapper().readValue(message.getPayload(), StatePayload.class));
            } else if (topic.isType(MessageType.NCMD) || topic.isType(MessageType.DCMD)) {
                final List<Metric> metrics =
                        new SparkplugBPayloadDecoder().buildFromByteArray(message.getPayload(), new MetricDataTypeMap()).getMetrics();
                Peer.say("command", topic.isType(MessageType.DCMD) ? topic.getDeviceId() : null, metrics);
                if (metrics.stream().anyMatch(m -> SparkplugMeta.METRIC_NODE_REBIRTH.equals(m.getName()) && Boolean.TRUE.equals(m.getValue()))) {
                    client.handleRebirthRequest(true);
                }
            }
        } catch (final Exception error) {
            error.printStackTrace();
        }
    }

    @Override
    public void connectionLost(final MqttServerName server, final MqttServerUrl url, final MqttClientId id, final Throwable cause) {}

    @Override
    public void connectComplete(final boolean again, final MqttServerName server, final MqttServerUrl url, final MqttClientId id) {}

    @Override
    public void shutdown() {}
}
