package cnctwin;

import com.hivemq.extension.sdk.api.ExtensionMain;
import com.hivemq.extension.sdk.api.auth.SimpleAuthenticator;
import com.hivemq.extension.sdk.api.auth.parameter.SimpleAuthInput;
import com.hivemq.extension.sdk.api.auth.parameter.SimpleAuthOutput;
import com.hivemq.extension.sdk.api.auth.parameter.TopicPermission;
import com.hivemq.extension.sdk.api.client.parameter.Listener;
import com.hivemq.extension.sdk.api.packets.auth.DefaultAuthorizationBehaviour;
import com.hivemq.extension.sdk.api.packets.connect.ConnackReasonCode;
import com.hivemq.extension.sdk.api.parameter.ExtensionStartInput;
import com.hivemq.extension.sdk.api.parameter.ExtensionStartOutput;
import com.hivemq.extension.sdk.api.parameter.ExtensionStopInput;
import com.hivemq.extension.sdk.api.parameter.ExtensionStopOutput;
import com.hivemq.extension.sdk.api.services.Services;
import com.hivemq.extension.sdk.api.services.builder.Builders;
import java.nio.ByteBuffer;
import java.nio.charset.StandardCharsets;
import java.nio.file.Path;
import java.security.GeneralSecurityException;
import java.security.MessageDigest;
import java.util.ArrayList;
import java.util.Base64;
import java.util.HashMap;
import java.util.List;
import java.util.Map;
import javax.crypto.SecretKeyFactory;
import javax.crypto.spec.PBEKeySpec;
import javax.xml.parsers.DocumentBuilderFactory;
import org.w3c.dom.Document;
import org.w3c.dom.Element;
import org.w3c.dom.NodeList;

/**
 * Stands in for the File RBAC extension of HiveMQ, which no registry of packages has: reads the same file of users (hashed
 * passwords) and roles, and hands HiveMQ the same permissions. Who may do what HiveMQ itself decides, here as there.
 *
 * <p>Only the listener "session-tests" lets everybody in and do everything.
 */
final class Rules implements ExtensionMain, SimpleAuthenticator {

    private static final String OPEN_LISTENER = "session-tests";

    private record User(String password, List<String> roles) {}

    private record Permission(Map<String, String> is) {}

    private final Map<String, User> users = new HashMap<>();
    private final Map<String, List<Permission>> roles = new HashMap<>();

    Rules(final Path file) throws Exception {
        final Document document = DocumentBuilderFactory.newInstance().newDocumentBuilder().parse(file.toFile());
        for (final Element user : children(document.getDocumentElement(), "users", "user")) {
            final List<String> of = new ArrayList<>();
            children(user, "roles", "id").forEach(id -> of.add(id.getTextContent().strip()));
            users.put(text(user, "name"), new User(text(user, "password"), of));
        }
        for (final Element role : children(document.getDocumentElement(), "roles", "role")) {
            final List<Permission> permissions = new ArrayList<>();
            for (final Element permission : children(role, "permissions", "permission")) {
                final Map<String, String> is = new HashMap<>();
                final NodeList parts = permission.getChildNodes();
                for (int index = 0; index < parts.getLength(); index++) {
                    if (parts.item(index) instanceof Element part) {
                        is.put(part.getTagName(), part.getTextContent().strip());
                    }
                }
                permissions.add(new Permission(is));
            }
            roles.put(text(role, "id"), permissions);
        }
    }

    @Override
    public void extensionStart(final ExtensionStartInput input, final ExtensionStartOutput output) {
        Services.securityRegistry().setAuthenticatorProvider(ignored -> this);
    }

    @Override
    public void extensionStop(final ExtensionStopInput input, final ExtensionStopOutput output) {}

    @Override
    public void onConnect(final SimpleAuthInput input, final SimpleAuthOutput output) {
        if (input.getConnectionInformation().getListener().map(Listener::getName).filter(OPEN_LISTENER::equals).isPresent()) {
            output.authenticateSuccessfully();
            return;
        }
        final String name = input.getConnectPacket().getUserName().orElse("");
        final String client = input.getClientInformation().getClientId();
        final User user = users.get(name);
        final ByteBuffer password = input.getConnectPacket().getPassword().orElse(null);
        if (user == null || password == null || wild(name) || wild(client) || !matches(password, user.password())) {
            output.failAuthentication(ConnackReasonCode.NOT_AUTHORIZED, "invalid credentials");
            return;
        }
        for (final String role : user.roles()) {
            for (final Permission permission : roles.get(role)) {
                output.getDefaultPermissions().add(allowed(permission, name, client));
            }
        }
        output.getDefaultPermissions().setDefaultBehaviour(DefaultAuthorizationBehaviour.DENY);
        output.authenticateSuccessfully();
    }

    private static TopicPermission allowed(final Permission permission, final String name, final String client) {
        final Map<String, String> is = permission.is();
        return Builders.topicPermission()
                .topicFilter(is.get("topic").replace("${{username}}", name).replace("${{clientid}}", client))
                .type(TopicPermission.PermissionType.ALLOW)
                .activity(TopicPermission.MqttActivity.valueOf(is.getOrDefault("activity", "ALL")))
                .qos(TopicPermission.Qos.valueOf(is.getOrDefault("qos", "ALL")))
                .retain(TopicPermission.Retain.valueOf(is.getOrDefault("retain", "ALL")))
                .sharedSubscription(TopicPermission.SharedSubscription.valueOf(is.getOrDefault("shared-subscription", "ALL")))
                .sharedGroup(is.getOrDefault("shared-group", "#"))
                .build();
    }

    private static boolean wild(final String text) {
        return text.contains("#") || text.contains("+");
    }

    /** The form of the extension: salt, iterations and hash, PBKDF2 with SHA-512. */
    private static boolean matches(final ByteBuffer given, final String kept) {
        final String[] parts = kept.split(":");
        if (parts.length != 3) {
            return false;
        }
        final char[] password = StandardCharsets.UTF_8.decode(given).toString().toCharArray();
        final Base64.Decoder decoder = Base64.getDecoder();
        try {
            final var key = new PBEKeySpec(password, decoder.decode(parts[0]), Integer.parseInt(parts[1]), 512);
            final byte[] hash = SecretKeyFactory.getInstance("PBKDF2WithHmacSHA512").generateSecret(key).getEncoded();
            return MessageDigest.isEqual(hash, decoder.decode(parts[2]));
        } catch (final GeneralSecurityException | IllegalArgumentException error) {
            return false;
        }
    }

    private static String text(final Element parent, final String name) {
        return ((Element) parent.getElementsByTagName(name).item(0)).getTextContent().strip();
    }

    private static List<Element> children(final Element parent, final String list, final String name) {
        final List<Element> found = new ArrayList<>();
        final NodeList lists = parent.getChildNodes();
        for (int outer = 0; outer < lists.getLength(); outer++) {
            if (lists.item(outer) instanceof Element one && one.getTagName().equals(list)) {
                final NodeList elements = one.getChildNodes();
                for (int inner = 0; inner < elements.getLength(); inner++) {
                    if (elements.item(inner) instanceof Element element && element.getTagName().equals(name)) {
                        found.add(element);
                    }
                }
            }
        }
        return found;
    }
}
