import com.fasterxml.jackson.databind.JsonNode;
import java.lang.reflect.Proxy;
import java.util.ArrayList;
import java.util.Date;
import java.util.List;
import org.eclipse.tahu.exception.TahuException;
import org.eclipse.tahu.host.HostApplication;
import org.eclipse.tahu.host.api.MultiHostApplicationEventHandler;
import org.eclipse.tahu.message.SparkplugBPayloadDecoder;
import org.eclipse.tahu.message.model.DeviceDescriptor;
import org.eclipse.tahu.message.model.EdgeNodeDescriptor;
import org.eclipse.tahu.message.model.Message;
import org.eclipse.tahu.message.model.MessageType;
import org.eclipse.tahu.message.model.Metric;
import org.eclipse.tahu.message.model.SparkplugBPayload;
import org.eclipse.tahu.message.model.SparkplugMeta;
import org.eclipse.tahu.message.model.Topic;
import org.eclipse.tahu.model.MqttServerDefinition;
import org.eclipse.tahu.mqtt.MqttClientId;
import org.eclipse.tahu.mqtt.MqttServerName;
import org.eclipse.tahu.mqtt.MqttServerUrl;

/** Tahu's HostApplication, whose events become lines. */
final class Host implements Peer.Role {

    private static final int ATTEMPTS_MAX = 100;
    private static final long PAUSE_MS = 100;

    private final HostApplication application;
    private final String group;

    Host(final String url, final String group, final String hostId) throws Exception {
        this.group = group;
        final MqttServerDefinition server = new MqttServerDefinition(
                new MqttServerName("broker"), new MqttClientId("tahu-" + hostId, false), new MqttServerUrl(url), null, null, 30, null);
        final MultiHostApplicationEventHandler events = (MultiHostApplicationEventHandler) Proxy.newProxyInstance(
                Host.class.getClassLoader(), new Class<?>[] {MultiHostApplicationEventHandler.class}, (proxy, method, given) -> {
                    heard(method.getName(), given);
                    return null;
                });
        application = new HostApplication(
                events, hostId, List.of("spBv1.0/" + group + "/#"), List.of(server), null, new SparkplugBPayloadDecoder(), true);
        application.start(true);
    }

    private static void heard(final String event, final Object[] given) {
        final String device = given != null && given.length > 1 && given[1] instanceof DeviceDescriptor one ? one.getDeviceId() : null;
        switch (event) {
            case "onNodeBirthArrived", "onDeviceBirthArrived" ->
                Peer.say("birth", device, ((Message) given[2]).getPayload().getMetrics());
            case "onDataMetric" -> Peer.say("data", device, List.of((Metric) given[2]));
            case "onNodeDeath", "onDeviceDeath" -> Peer.say("death", device, null);
            default -> {}
        }
    }

    @Override
    public boolean told(final JsonNode line) throws Exception {
        if (line.get("do").asText().equals("stop")) {
            application.shutdown();
            return false;
        }
        final String node = line.get("node").asText();
        final String prefix = SparkplugMeta.SPARKPLUG_B_TOPIC_PREFIX;
        final Topic topic = line.hasNonNull("device")
                ? new Topic(prefix, new DeviceDescriptor(group, node, line.get("device").asText()), MessageType.DCMD)
                : new Topic(prefix, new EdgeNodeDescriptor(group, node), MessageType.NCMD);
        publish(topic, new SparkplugBPayload(new Date(), new ArrayList<>(Peer.metrics(line.get("metrics")))));
        return true;
    }

    /** Tahu refuses a command while it does not know yet that it is connected again, though its STATE is on the broker. */
    private void publish(final Topic topic, final SparkplugBPayload payload) throws Exception {
        for (int attempt = 1; ; attempt++) {
            try {
                application.publishCommand(topic, payload);
                return;
            } catch (final TahuException error) {
                if (attempt == ATTEMPTS_MAX) {
                    throw error;
                }
                Thread.sleep(PAUSE_MS);
            }
        }
    }
}
