package main

import (
	"bytes"
	"encoding/binary"
	"errors"
	"fmt"
	"hash/crc32"
	"io"

	"github.com/foxglove/mcap/go/mcap"
	"github.com/klauspost/compress/zstd"
)

// chunk is a chunk where it lies, with the indexes of its messages.
type chunk struct {
	*mcap.Chunk
	start, length uint64
	indexes       map[uint16]*mcap.MessageIndex
	// where each of these lies, and the bytes of all of them
	offsets map[uint16]uint64
	bytes   uint64
}

// chunks takes every chunk apart and holds what is in it against what is said of it: sizes, times and check sum of its own head, the indexes
// of its messages, the index of chunks and the statistics.
func chunks(file []byte, info *mcap.Info) error {
	found, err := cut(file)
	if err != nil {
		return err
	}
	if len(info.ChunkIndexes) != len(found) {
		return fmt.Errorf("%d chunks, %d of them indexed", len(found), len(info.ChunkIndexes))
	}
	counts := map[uint16]uint64{}
	for _, index := range info.ChunkIndexes {
		c := found[index.ChunkStartOffset]
		if c == nil {
			return fmt.Errorf("no chunk at %d", index.ChunkStartOffset)
		}
		if err := c.messages(info, counts); err != nil {
			return fmt.Errorf("chunk at %d: %w", c.start, err)
		}
		if c.length != index.ChunkLength || c.MessageStartTime != index.MessageStartTime || c.MessageEndTime != index.MessageEndTime ||
			c.Compression != string(index.Compression) || uint64(len(c.Records)) != index.CompressedSize ||
			c.UncompressedSize != index.UncompressedSize || c.bytes != index.MessageIndexLength {
			return fmt.Errorf("chunk at %d: its index says something else: %+v", c.start, index)
		}
		if len(index.MessageIndexOffsets) != len(c.offsets) {
			return fmt.Errorf("chunk at %d: %d of %d message indexes are known", c.start, len(index.MessageIndexOffsets), len(c.offsets))
		}
		for id, offset := range c.offsets {
			if index.MessageIndexOffsets[id] != offset {
				return fmt.Errorf("chunk at %d: the index of channel %d lies at %d, not at %d", c.start, id, offset, index.MessageIndexOffsets[id])
			}
		}
	}
	for id, count := range counts {
		if info.Statistics.ChannelMessageCounts[id] != count {
			return fmt.Errorf("channel %d has %d messages, not %d", id, count, info.Statistics.ChannelMessageCounts[id])
		}
	}
	return nil
}

// cut gives the chunks of a file by where they begin.
func cut(file []byte) (map[uint64]*chunk, error) {
	reader := bytes.NewReader(file)
	lexer, err := mcap.NewLexer(reader, &mcap.LexerOptions{EmitChunks: true})
	if err != nil {
		return nil, err
	}
	defer lexer.Close()
	found := map[uint64]*chunk{}
	var last *chunk
	for {
		token, data, err := lexer.Next(nil)
		if errors.Is(err, io.EOF) {
			return found, nil
		}
		if err != nil {
			return nil, err
		}
		position, _ := reader.Seek(0, io.SeekCurrent)
		length := uint64(len(data)) + 9
		start := uint64(position) - length
		switch token {
		case mcap.TokenChunk:
			parsed, err := mcap.ParseChunk(data)
			if err != nil {
				return nil, err
			}
			last = &chunk{Chunk: parsed, start: start, length: length, indexes: map[uint16]*mcap.MessageIndex{}, offsets: map[uint16]uint64{}}
			found[start] = last
		case mcap.TokenMessageIndex:
			index, err := mcap.ParseMessageIndex(data)
			if err != nil {
				return nil, err
			}
			if last == nil || last.indexes[index.ChannelID] != nil {
				return nil, fmt.Errorf("an index of channel %d at %d without a chunk, or a second one", index.ChannelID, start)
			}
			last.indexes[index.ChannelID], last.offsets[index.ChannelID] = index, start
			last.bytes += length
		default:
			last = nil
		}
	}
}

// messages holds a chunk's messages against its head and their indexes, and counts them.
func (c *chunk) messages(info *mcap.Info, counts map[uint16]uint64) error {
	records := c.Records
	switch c.Compression {
	case "":
	case "zstd":
		decoder, err := zstd.NewReader(nil)
		if err != nil {
			return err
		}
		defer decoder.Close()
		if records, err = decoder.DecodeAll(c.Records, nil); err != nil {
			return err
		}
	default:
		return fmt.Errorf("compressed by %q", c.Compression)
	}
	if uint64(len(records)) != c.UncompressedSize || crc32.ChecksumIEEE(records) != c.UncompressedCRC || c.UncompressedCRC == 0 {
		return fmt.Errorf("%d bytes with sum %x, not %d with %x", len(records), crc32.ChecksumIEEE(records), c.UncompressedSize, c.UncompressedCRC)
	}
	seen, first, last, all := map[uint16]int{}, uint64(0), uint64(0), 0
	for at := uint64(0); at < uint64(len(records)); {
		if uint64(len(records))-at < 9 {
			return fmt.Errorf("half a record at %d", at)
		}
		length := binary.LittleEndian.Uint64(records[at+1:])
		if length > uint64(len(records))-at-9 {
			return fmt.Errorf("a record of %d bytes at %d", length, at)
		}
		data := records[at+9 : at+9+length]
		switch mcap.OpCode(records[at]) {
		case mcap.OpSchema, mcap.OpChannel:
		case mcap.OpMessage:
			message, err := mcap.ParseMessage(data)
			if err != nil {
				return err
			}
			channel := info.Channels[message.ChannelID]
			if channel == nil || info.Schemas[channel.SchemaID] == nil {
				return fmt.Errorf("channel %d or its schema is not in the summary", message.ChannelID)
			}
			// The entries are in the order of the messages, and each leads to its own.
			index, k := c.indexes[message.ChannelID], seen[message.ChannelID]
			if index == nil || k >= len(index.Records) || index.Records[k].Offset != at || index.Records[k].Timestamp != message.LogTime {
				return fmt.Errorf("message %d of channel %d at %d is not where its index says", k, message.ChannelID, at)
			}
			if all == 0 || message.LogTime < first {
				first = message.LogTime
			}
			last = max(last, message.LogTime)
			seen[message.ChannelID], all = k+1, all+1
			counts[message.ChannelID]++
		default:
			return fmt.Errorf("a record of kind %d", records[at])
		}
		at += 9 + length
	}
	for id, index := range c.indexes {
		if len(index.Records) != seen[id] {
			return fmt.Errorf("%d messages of channel %d, %d indexed", seen[id], id, len(index.Records))
		}
	}
	if all > 0 && (first != c.MessageStartTime || last != c.MessageEndTime) {
		return fmt.Errorf("messages from %d to %d, not %d to %d", first, last, c.MessageStartTime, c.MessageEndTime)
	}
	return nil
}
