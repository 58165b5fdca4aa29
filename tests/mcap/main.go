// Reads logs of hystctl with Foxglove's Go library and compares them with what hystctl says of them.
//
//	go run . FOLDER
//
// FOLDER is what `cargo run -p hyst-tests --example every_log -- FOLDER` makes. Every record is looked at, in order, by the indexes and chunk by
// chunk; all check sums are computed again. That is all that `mcap doctor` looks at, and the values of the samples.
package main

import (
	"bytes"
	"encoding/csv"
	"encoding/json"
	"errors"
	"fmt"
	"hash/crc32"
	"io"
	"math"
	"os"
	"path/filepath"
	"reflect"
	"strconv"

	"github.com/foxglove/mcap/go/mcap"
)

// entry is what hystctl says of one log.
type entry struct {
	Log      string            `json:"log"`
	Samples  string            `json:"samples"`
	Model    bool              `json:"model"`
	Metadata map[string]string `json:"metadata"`
}

// Topics.
const (
	samplesTopic = "/actuator/sample"
	eventsTopic  = "/actuator/event"
)

// seen is what a reader found.
type seen struct {
	messages []mcap.Message
	// of any topic
	count  uint64
	chunks uint32
	model  []byte
	// by their names
	metadata map[string]map[string]string
	schemas  map[uint16]bool
	channels map[uint16]*mcap.Channel
}

func main() {
	if len(os.Args) != 2 {
		fmt.Fprintln(os.Stderr, "error: give the folder of the logs")
		os.Exit(2)
	}
	folder := os.Args[1]
	list, err := os.ReadFile(filepath.Join(folder, "logs.json"))
	var logs []entry
	if err == nil {
		err = json.Unmarshal(list, &logs)
	}
	if err == nil && len(logs) == 0 {
		err = errors.New("there are no logs")
	}
	if err != nil {
		fmt.Fprintln(os.Stderr, "error:", err)
		os.Exit(1)
	}
	failed := 0
	for _, log := range logs {
		if err := check(folder, log); err != nil {
			fmt.Fprintf(os.Stderr, "error: %s: %v\n", log.Log, err)
			failed++
		}
	}
	fmt.Printf("%d logs, %d of them in order\n", len(logs), len(logs)-failed)
	if failed > 0 {
		os.Exit(1)
	}
}

func check(folder string, log entry) error {
	file, err := os.ReadFile(filepath.Join(folder, log.Log))
	if err != nil {
		return err
	}
	found, err := inOrder(file)
	if err != nil {
		return err
	}
	if err := byIndex(file, found); err != nil {
		return err
	}
	said := map[string]string{}
	for name, entries := range found.metadata {
		for key, value := range entries {
			if name != "run" {
				key = name + "." + key
			}
			said[key] = value
		}
	}
	if !reflect.DeepEqual(said, log.Metadata) {
		return fmt.Errorf("metadata %v, not %v", said, log.Metadata)
	}
	if log.Model {
		model, err := os.ReadFile(filepath.Join(folder, "model.json"))
		if err != nil || !bytes.Equal(model, found.model) {
			return fmt.Errorf("the model is another one (%v)", err)
		}
	}
	return samples(filepath.Join(folder, log.Samples), found.messages)
}

// inOrder reads record after record.
func inOrder(file []byte) (*seen, error) {
	found := &seen{metadata: map[string]map[string]string{}, schemas: map[uint16]bool{}, channels: map[uint16]*mcap.Channel{}}
	reader := bytes.NewReader(file)
	lexer, err := mcap.NewLexer(reader, &mcap.LexerOptions{
		ValidateChunkCRCs:     true,
		ComputeAttachmentCRCs: true,
		AttachmentCallback: func(a *mcap.AttachmentReader) error {
			data, err := io.ReadAll(a.Data())
			if err != nil {
				return err
			}
			computed, err := a.ComputedCRC()
			if err != nil {
				return err
			}
			if stated, err := a.ParsedCRC(); err != nil || stated != computed {
				return fmt.Errorf("attachment %s: check sum %x, not %x (%v)", a.Name, stated, computed, err)
			}
			found.model = data
			return nil
		},
	})
	if err != nil {
		return nil, err
	}
	defer lexer.Close()
	ended, closed, latest, numbers := false, false, uint64(0), map[uint16]uint32{}
	for {
		token, data, err := lexer.Next(nil)
		if errors.Is(err, io.EOF) {
			break
		}
		if err != nil {
			return nil, err
		}
		switch token {
		case mcap.TokenHeader:
			header, err := mcap.ParseHeader(data)
			if err != nil || header.Library == "" {
				return nil, fmt.Errorf("the header names no library (%v)", err)
			}
		case mcap.TokenSchema:
			schema, err := mcap.ParseSchema(data)
			if err != nil || schema.ID == 0 || schema.Encoding != "jsonschema" || !json.Valid(schema.Data) {
				return nil, fmt.Errorf("schema %v (%v)", schema, err)
			}
			if found.schemas[schema.ID] != ended {
				return nil, fmt.Errorf("schema %d twice among the data, or in the summary alone", schema.ID)
			}
			found.schemas[schema.ID] = true
		case mcap.TokenChannel:
			channel, err := mcap.ParseChannel(data)
			unit := map[string]string{samplesTopic: "unit.output", eventsTopic: "unit.time_s"}[channel.Topic]
			if err != nil || !found.schemas[channel.SchemaID] || channel.Metadata[unit] == "" {
				return nil, fmt.Errorf("channel %v (%v)", channel, err)
			}
			if before := found.channels[channel.ID]; (before != nil) != ended || ended && !reflect.DeepEqual(before, channel) {
				return nil, fmt.Errorf("channel %d twice among the data, or another one in the summary", channel.ID)
			}
			found.channels[channel.ID] = channel
		case mcap.TokenMessage:
			message, err := mcap.ParseMessage(data)
			if err != nil || found.channels[message.ChannelID] == nil {
				return nil, fmt.Errorf("message %d before its channel (%v)", found.count, err)
			}
			if message.LogTime < latest || message.Sequence != numbers[message.ChannelID] {
				return nil, fmt.Errorf("message %d is number %d at %d ns after %d ns",
					found.count, message.Sequence, message.LogTime, latest)
			}
			latest = message.LogTime
			numbers[message.ChannelID]++
			found.count++
			if found.channels[message.ChannelID].Topic == eventsTopic {
				if !json.Valid(message.Data) {
					return nil, fmt.Errorf("event %q", message.Data)
				}
				continue
			}
			message.Data = bytes.Clone(message.Data)
			found.messages = append(found.messages, *message)
		case mcap.TokenMetadata:
			metadata, err := mcap.ParseMetadata(data)
			if err != nil || found.metadata[metadata.Name] != nil {
				return nil, fmt.Errorf("metadata %v, or twice of this name (%v)", metadata, err)
			}
			found.metadata[metadata.Name] = metadata.Metadata
		case mcap.TokenDataEnd:
			end, err := mcap.ParseDataEnd(data)
			if err != nil {
				return nil, err
			}
			position, _ := reader.Seek(0, io.SeekCurrent)
			before := file[:position-int64(len(data))-9]
			if sum := crc32.ChecksumIEEE(before); end.DataSectionCRC != sum {
				return nil, fmt.Errorf("check sum of the data %x, not %x", end.DataSectionCRC, sum)
			}
			ended = true
		case mcap.TokenFooter:
			footer, err := mcap.ParseFooter(data)
			if err != nil {
				return nil, err
			}
			position, _ := reader.Seek(0, io.SeekCurrent)
			if sum := crc32.ChecksumIEEE(file[footer.SummaryStart : position-4]); footer.SummaryCRC != sum {
				return nil, fmt.Errorf("check sum of the summary %x, not %x", footer.SummaryCRC, sum)
			}
			closed = true
		}
	}
	if !ended || !closed {
		return nil, errors.New("it was not closed")
	}
	return found, nil
}

// byIndex reads it as a viewer does that jumps to where it wants to be.
func byIndex(file []byte, found *seen) error {
	reader, err := mcap.NewReader(bytes.NewReader(file))
	if err != nil {
		return err
	}
	defer reader.Close()
	info, err := reader.Info()
	if err != nil {
		return err
	}
	count := found.count
	s := info.Statistics
	if s == nil || s.MessageCount != count || int(s.ChannelCount) != len(found.channels) || int(s.SchemaCount) != len(found.schemas) ||
		int(s.ChunkCount) != len(info.ChunkIndexes) || int(s.AttachmentCount) != len(info.AttachmentIndexes) {
		return fmt.Errorf("statistics %v for %d messages in %d chunks", s, count, len(info.ChunkIndexes))
	}
	if len(info.ChunkIndexes) == 0 || len(info.MetadataIndexes) != len(found.metadata) {
		return fmt.Errorf("%d chunks and %d metadata records are indexed", len(info.ChunkIndexes), len(info.MetadataIndexes))
	}
	if err := chunks(file, info); err != nil {
		return err
	}
	for _, index := range info.MetadataIndexes {
		metadata, err := reader.GetMetadata(index.Offset)
		if err != nil || metadata.Name != index.Name || !reflect.DeepEqual(metadata.Metadata, found.metadata[index.Name]) {
			return fmt.Errorf("other metadata by the index (%v)", err)
		}
	}
	messages, err := reader.Messages(mcap.UsingIndex(true), mcap.InOrder(mcap.LogTimeOrder))
	if err != nil {
		return err
	}
	next := 0
	first, latest := uint64(math.MaxUint64), uint64(0)
	err = mcap.Range(messages, func(_ *mcap.Schema, channel *mcap.Channel, message *mcap.Message) error {
		first, latest = min(first, message.LogTime), max(latest, message.LogTime)
		if channel.Topic == eventsTopic {
			return nil
		}
		if next >= len(found.messages) || !bytes.Equal(message.Data, found.messages[next].Data) {
			return fmt.Errorf("message %d is another one by the index", next)
		}
		next++
		return nil
	})
	if err == nil && next != len(found.messages) {
		err = fmt.Errorf("%d of %d messages by the index", next, len(found.messages))
	}
	if err == nil && count > 0 && (s.MessageStartTime != first || s.MessageEndTime != latest) {
		err = fmt.Errorf("it goes from %d to %d ns in the statistics, and from %d to %d", s.MessageStartTime, s.MessageEndTime, first, latest)
	}
	return err
}

// samples compares messages with the rows that hystctl makes of them.
func samples(path string, messages []mcap.Message) error {
	file, err := os.Open(path)
	if err != nil {
		return err
	}
	defer file.Close()
	rows, err := csv.NewReader(file).ReadAll()
	if err != nil {
		return err
	}
	if len(rows) != len(messages)+1 {
		return fmt.Errorf("%d messages, %d samples", len(messages), len(rows)-1)
	}
	names := map[string]string{"voltage_v": "drive_v", "displacement_um": "output", "reference_um": "reference"}
	for k, message := range messages {
		var sample map[string]any
		if err := json.Unmarshal(message.Data, &sample); err != nil {
			return fmt.Errorf("message %d: %w", k, err)
		}
		for column, cell := range rows[k+1] {
			name := rows[0][column]
			if other, ok := names[name]; ok {
				name = other
			}
			wanted, err := strconv.ParseFloat(cell, 64)
			if err != nil || sample[name] != wanted {
				return fmt.Errorf("message %d: %s = %v, not %s (%v)", k, name, sample[name], cell, err)
			}
		}
	}
	return nil
}
